"""The spatial twin: the robot of the published simulator in three dimensions, on MuJoCo (the extra ``spatial``)."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import DeviceFault
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Forces
from vvvaltr.twin.body import Body
from vvvaltr.twin.engine import LEVEL, Diverged, Start
from vvvaltr.twin.posture import Angles, continue_angles, fit_rotation, place_nodes, rotate_posture
from vvvaltr.twin.rotors import Rotors
from vvvaltr.twin.spatial.forces import read_forces
from vvvaltr.twin.spatial.model import HILLS_HALF_WIDTH_M, compile_model
from vvvaltr.twin.world import Flat, Hills, World

if TYPE_CHECKING:
    import mujoco


TIME_STEP_S = 0.0005
SETTLING_S = 3.0
FOOT_RADIUS_M = 0.03  # distance from the robot's middle to where it stands
FASTEST_STRUT_M_S = 20.0  # speed of a strut's middle; strong gaits stay below 1


class SpatialEngine:
    """``Engine`` in three dimensions.

    Args:
        body: body that moves.
        world: world that it moves in.
        time_step_s: time step of the integration; 0 for 0.5 ms, at which gaits move and rank as at finer steps.

    Raises:
        ValueError: MuJoCo is not installed.
        Diverged: the body cannot even be put down.
    """

    def __init__(self, body: Body, world: World, time_step_s: float = 0.0) -> None:
        self.body = body
        self.world = world
        self.time_step_s = time_step_s or TIME_STEP_S
        self._simulation = _Simulation(compile_model(body, world, self.time_step_s))
        self._halves_m = _halves_m(body)
        self._settled = _settle(body, world.gravity_m_s2, world.friction, self.time_step_s)
        self._settled_nodes_m = place_nodes(self._settled, self._halves_m)
        self.reset()

    def reset(self, start: Start = LEVEL) -> None:
        """See ``Engine``."""
        posture, self._angles_rad = self._put_down(start)
        self._simulation.begin(posture)
        self._rotors = Rotors(self.body.motors, self.time_step_s)
        self._due_s = 0.0
        self._steps = 0

    def incline(self, angle_rad: float, azimuth_rad: float) -> None:
        """See ``Engine``."""
        down, along = math.cos(angle_rad), math.sin(angle_rad)
        direction = np.array([along * math.cos(azimuth_rad), along * math.sin(azimuth_rad), -down])
        self._simulation.set_gravity(self.world.gravity_m_s2 * direction)

    @property
    def time_s(self) -> float:
        """See ``Engine``."""
        return self._steps * self.time_step_s

    def step(self, gait: Gait, duration_s: float) -> None:
        """See ``Engine``.

        Raises:
            DeviceFault: the robot left the hills, which end at ``HILLS_HALF_WIDTH_M``.
        """
        if gait.motor_count != len(self.body.motors):
            raise ValueError(f"a gait for {gait.motor_count} motors, but {self.body.name} has {len(self.body.motors)}")
        self._due_s += duration_s
        if (steps := round(self._due_s / self.time_step_s) - self._steps) > 0:
            self._simulation.go_on(self._controls(gait, steps))
            self._steps += steps
            self._simulation.check(self.time_s)
            self._check_place()
            rotation = fit_rotation(self.nodes_m(), self._settled_nodes_m)
            self._angles_rad = continue_angles(rotation, self._angles_rad)

    def nodes_m(self) -> Array:
        """See ``Engine``."""
        return place_nodes(self._simulation.posture(), self._halves_m)

    def angles_rad(self) -> tuple[float, float, float]:
        """See ``Engine``. They are those of the rotation that best carries the settled nodes to the present ones."""
        return self._angles_rad

    def applied_hz(self) -> tuple[float, ...]:
        """See ``Engine``."""
        return tuple(self._rotors.applied_hz.tolist())

    def forces(self) -> Forces:
        """See ``Engine``."""
        return self._simulation.forces(self.body)

    def _controls(self, gait: Gait, steps: int) -> Array:
        """Return two forces and the reaction torque of each motor for each step, shape (steps, 3 * motors)."""
        before_hz = self._rotors.applied_hz
        hz, forces_n = self._rotors.spin(gait, steps)
        # A rotor rotates from y to x, negative about z. As it speeds up, the strut is rotated the other way: positive.
        spin_up_hz_s = np.diff(hz, axis=0, prepend=before_hz[None]) / self.time_step_s
        torques_n_m = math.tau * spin_up_hz_s * [motor.rotor_kg_m2 for motor in self.body.motors]
        return np.stack([forces_n.real, forces_n.imag, torques_n_m], axis=2).reshape(steps, -1)

    def _put_down(self, start: Start) -> tuple[Array, Angles]:
        """Return the settled posture at ``start``, lying on the ground, and the angles that it is rotated by."""
        angles_rad = _lie_along_ground(self.world, start)
        centre_m = self.body.centre_m(self._settled_nodes_m)
        placed = rotate_posture(self._settled, angles_rad, centre_m)
        placed[:, :2] += [start.x_m - centre_m[0], start.y_m - centre_m[1]]
        nodes_m = place_nodes(placed, self._halves_m)
        gap_m = np.min(nodes_m[:, 2] - self.world.height_m(nodes_m[:, 0], nodes_m[:, 1]))
        placed[:, 2] += self._settled_nodes_m[:, 2].min() - gap_m
        return placed, angles_rad

    def _check_place(self) -> None:
        farthest_m = np.abs(self._simulation.posture()[:, :2]).max()
        if isinstance(self.world.ground, Hills) and farthest_m > HILLS_HALF_WIDTH_M:
            raise DeviceFault("off the hills", f"the robot left the hills, which end at {HILLS_HALF_WIDTH_M:g} m")


class _Simulation:
    """The simulation of a model, in calls of many steps each.

    The state is a row of MuJoCo's ``mjSTATE_FULLPHYSICS``: the time, 7 coordinates of each strut, 6 speeds of each.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        from mujoco import MjData
        from mujoco.rollout import Rollout

        self._model, self._data, self._still = model, MjData(model), MjData(model)
        self._rollout = Rollout(nthread=0)
        self._coordinates = slice(1, 1 + model.nq)

    def set_gravity(self, gravity_m_s2: Array) -> None:
        """Set gravity, a vector (3,) along the world's axes, from the next step on."""
        self._model.opt.gravity[:] = gravity_m_s2

    def begin(self, posture: Array) -> None:
        """Start from rest in ``posture``, at time 0."""
        self._state = np.concatenate([[0.0], posture.ravel(), np.zeros(self._model.nv)])
        self._control = np.zeros(self._model.nu)
        self._data.qacc_warmstart[:] = 0.0

    def go_on(self, controls: Array) -> None:
        """Make a step for each row of ``controls``, shape (steps, 3 * motors).

        The contact solver starts from its last result, so that several calls give the same motion as one.
        """
        warm = self._data.qacc_warmstart[None].copy()
        states, _ = self._rollout.rollout(self._model, self._data, self._state, controls[None], initial_warmstart=warm)
        self._state = states[0, -1]
        self._control = controls[-1]

    def posture(self) -> Array:
        """Return where the struts are now, see ``posture``."""
        return self._state[self._coordinates].reshape(-1, 7)

    def forces(self, body: Body) -> Forces:
        """Return the forces on the body in this state."""
        from mujoco import mj_forward, mj_setState, mjtState

        # In data of their own: those of the simulation must not change.
        data = self._still
        mj_setState(self._model, data, self._state, mjtState.mjSTATE_FULLPHYSICS)
        data.qacc_warmstart[:] = self._data.qacc_warmstart
        data.ctrl[:] = self._control
        mj_forward(self._model, data)
        return read_forces(self._model, data, body)

    def check(self, time_s: float) -> None:
        """Raise Diverged if the state is impossible for a robot, or is not the state at ``time_s``."""
        speeds_m_s = np.linalg.norm(self._state[self._coordinates.stop :].reshape(-1, 6)[:, :3], axis=1)
        if not (np.isfinite(self._state).all() and speeds_m_s.max() < FASTEST_STRUT_M_S):
            raise Diverged(
                f"the spatial twin broke down at {time_s:.3f} s: a strut moves at {speeds_m_s.max():.3g} m/s"
            )
        if abs(self._state[0] - time_s) > 1e-6:
            # MuJoCo stops at a state that it rejects and keeps it, which would look like a robot at rest.
            raise Diverged(f"the spatial twin broke down at {self._state[0]:.3f} s: MuJoCo stopped there")


def _lie_along_ground(world: World, start: Start) -> Angles:
    """Return yaw, pitch and roll of a robot that lies along the ground at ``start``, plus the start's own tilt."""
    # Points ahead, behind, to the left and to the right, roughly where the feet are.
    around = start.yaw_rad + np.array([0.0, math.pi, math.pi / 2.0, -math.pi / 2.0])
    ahead, behind, left, right = world.height_m(
        start.x_m + FOOT_RADIUS_M * np.cos(around), start.y_m + FOOT_RADIUS_M * np.sin(around)
    ).tolist()
    pitch_rad = math.atan2(behind - ahead, 2.0 * FOOT_RADIUS_M)
    roll_rad = math.atan2((left - right) * math.cos(pitch_rad), 2.0 * FOOT_RADIUS_M)
    return start.yaw_rad, start.pitch_rad + pitch_rad, roll_rad


@lru_cache(maxsize=64)
def _settle(body: Body, gravity_m_s2: float, friction: float, time_step_s: float) -> Array:
    """Return the posture in which the body stands on level ground: released in its design state, then at rest."""
    model = compile_model(body, World(gravity_m_s2, friction, Flat()), time_step_s)
    design = model.qpos0.reshape(-1, 7).copy()
    design[:, 2] += body.struts[0].radius_m
    simulation = _Simulation(model)
    simulation.begin(design)
    simulation.go_on(np.zeros((round(SETTLING_S / time_step_s), model.nu)))
    simulation.check(SETTLING_S)
    return simulation.posture().copy()


def _halves_m(body: Body) -> Array:
    nodes_m = np.array(body.nodes_m)
    return np.asarray(np.linalg.norm(nodes_m[0::2] - nodes_m[1::2], axis=1) / 2.0)
