"""Makes a MuJoCo model of a body and a world: rigid bodies for struts, tendons for springs, site forces for motors.

Strut ``i`` is body ``i + 1``, and its axis is the body's z. Motor ``k`` has the controls ``3 k`` (force along the
strut's x), ``3 k + 1`` (force along its y) and ``3 k + 2`` (torque about its axis).
"""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.errors import UserError
from vvvaltr.twin.body import Body, Shape
from vvvaltr.twin.world import Ground, Hills, Slope, World

if TYPE_CHECKING:
    import mujoco


HOOK_M = 0.002  # springs hang on hooks beside the strut: on its axis, nothing would hold the strut's spin
AXIAL_GYRATION_M = 0.006  # board, battery and motor sit beside the axis and are most of the axial inertia
HILLS_HALF_WIDTH_M = 1.5  # where the hills end
POINTS_PER_WAVE = 10  # of the height field
SOLVER_ITERATIONS = 30
# MuJoCo's parameters of a contact: time constant in seconds and damping ratio; stiffness as a function of depth.
SOLREF = (0.004, 1.0)
SOLIMP = (0.9, 0.95, 0.0005, 0.5, 2.0)


def compile_model(body: Body, world: World, time_step_s: float, hook_m: float = HOOK_M) -> mujoco.MjModel:
    """Return the model, with the body in its design state.

    Args:
        body: body that moves.
        world: world that it moves in.
        time_step_s: time step of the integration.
        hook_m: distance of the springs' ends from the struts' axes.

    Raises:
        ValueError: MuJoCo is not installed.
    """
    spec = _quiet_mujoco().MjSpec()
    _set_options(spec, world.gravity_m_s2, time_step_s)
    _add_ground(spec, world.ground)
    frames = find_strut_frames(np.array(body.nodes_m))
    for strut, frame in enumerate(frames):
        _add_strut(spec, body, strut, frame)
        _let_touch(spec, strut, world.friction)
    for spring in range(len(body.springs)):
        _add_spring(spec, body, spring, frames, hook_m)
    for number, motor in enumerate(body.motors):
        _add_motor(spec, number, motor.strut)
    return spec.compile()


def find_strut_frames(nodes_m: Array) -> Array:
    """Return each strut's axes as the columns of a matrix, shape (struts, 3, 3), for nodes of shape (2 * struts, 3).

    z points from bottom to top and x is level. A rotation about the vertical that carries one strut into another then
    carries its frame, and with it its motor, into the other's too.
    """
    z = nodes_m[0::2] - nodes_m[1::2]
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.cross([0.0, 0.0, 1.0], z)
    x[np.linalg.norm(x, axis=1) < 1e-9] = [1.0, 0.0, 0.0]
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=2)


def _import_mujoco() -> Any:
    """Import MuJoCo, even where MUJOCO_GL names a renderer that this computer lacks: the twin renders nothing."""
    try:
        import mujoco
    except ModuleNotFoundError:
        raise
    except (ImportError, AttributeError, RuntimeError):
        wanted = os.environ.pop("MUJOCO_GL", None)
        if wanted is None:
            raise
        os.environ["MUJOCO_GL"] = "disable"
        try:
            import mujoco
        finally:
            os.environ["MUJOCO_GL"] = wanted
    return mujoco


def _quiet_mujoco() -> Any:
    """Import MuJoCo and switch its own log off, on disk and screen: the engine itself says what went wrong."""
    try:
        mujoco = _import_mujoco()
    except ModuleNotFoundError:
        raise UserError('the spatial twin needs MuJoCo: pip install "vvvaltr[spatial]"') from None
    log = mujoco.MjLogConfig.get()
    log.logto_file = log.logto_console = False
    log.set()
    return mujoco


def _set_options(spec: mujoco.MjSpec, gravity_m_s2: float, time_step_s: float) -> None:
    import mujoco

    option, off = spec.option, mujoco.mjtDisableBit
    option.timestep = time_step_s
    option.gravity = [0.0, 0.0, -gravity_m_s2]
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # With so few contacts, the projected Gauss-Seidel solver agrees with Newton's to 1e-8 m in half the time.
    option.solver = mujoco.mjtSolver.mjSOL_PGS
    option.iterations = SOLVER_ITERATIONS
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # Without the automatic reset, a state that broke down stays as it is and is noticed.
    option.disableflags = off.mjDSBL_AUTORESET.value | off.mjDSBL_ISLAND.value


def _add_ground(spec: mujoco.MjSpec, ground: Ground) -> None:
    import mujoco

    if isinstance(ground, Hills):
        shape = {
            "type": mujoco.mjtGeom.mjGEOM_HFIELD,
            "hfieldname": "hills",
            "pos": [0.0, 0.0, _add_hills(spec, ground)],
        }
    else:
        half_rad = ground.angle_rad / 2.0 if isinstance(ground, Slope) else 0.0
        quaternion = [math.cos(half_rad), 0.0, -math.sin(half_rad), 0.0]
        shape = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0], "quat": quaternion}
    spec.worldbody.add_geom(name="ground", contype=0, conaffinity=0, **shape)


def _add_hills(spec: mujoco.MjSpec, hills: Hills) -> float:
    """Add the height field and return the height of its lowest point, in metres."""
    points = 1 + math.ceil(2.0 * HILLS_HALF_WIDTH_M * POINTS_PER_WAVE / hills.wavelength_m)
    line = np.linspace(-HILLS_HALF_WIDTH_M, HILLS_HALF_WIDTH_M, points)
    heights = hills.at(line[None, :], line[:, None])  # a row of the field is a line of one y
    low, high = float(heights.min()), float(heights.max())
    spec.add_hfield(
        name="hills",
        nrow=points,
        ncol=points,
        size=[HILLS_HALF_WIDTH_M, HILLS_HALF_WIDTH_M, max(high - low, 1e-9), 0.1],
        userdata=heights.ravel(),
    )
    return low


def _add_strut(spec: mujoco.MjSpec, body: Body, strut: int, frame: Array) -> None:
    import mujoco

    half_m, middle_m = _half_m(body, strut), (_node(body, 2 * strut) + _node(body, 2 * strut + 1)) / 2.0
    mass_kg, radius_m = float(body.masses_kg[strut]), body.struts[strut].radius_m
    across = mass_kg * half_m**2 / 3.0
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, frame.ravel())
    part = spec.worldbody.add_body(
        name=f"strut{strut}",
        pos=middle_m,
        quat=quaternion,
        explicitinertial=True,
        mass=mass_kg,
        ipos=[0.0, 0.0, 0.0],
        inertia=[across, across, mass_kg * AXIAL_GYRATION_M**2],
    )
    part.add_freejoint()
    if body.struts[strut].shape is Shape.CAPSULE:
        shape = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "size": [radius_m, half_m, 0.0]}
    else:
        shape = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [radius_m, radius_m, half_m]}
    part.add_geom(name=f"strut{strut}", contype=0, conaffinity=0, **shape)


def _let_touch(spec: mujoco.MjSpec, strut: int, friction: float) -> None:
    """Let a strut touch the ground and nothing else. With named pairs, MuJoCo need not search for contacts."""
    sliding, turning, rolling = max(friction, 1e-5), 0.005, 0.0001
    spec.add_pair(
        geomname1="ground",
        geomname2=f"strut{strut}",
        condim=3,
        friction=[sliding, sliding, turning, rolling, rolling],
        solref=SOLREF,
        solimp=SOLIMP,
    )


def _add_spring(spec: mujoco.MjSpec, body: Body, number: int, frames: Array, hook_m: float) -> None:
    spring = body.springs[number]
    tendon = spec.add_tendon(
        name=f"spring{number}",
        stiffness=spring.stiffness_n_m,
        damping=spring.damping_n_s_m,
        springlength=[0.0 if body.tension_only else spring.rest_m, spring.rest_m],
    )
    for node, other in (spring.nodes, spring.nodes[::-1]):
        strut, side = node // 2, 1.0 - 2.0 * (node % 2)
        towards = frames[strut].T @ (_node(body, other) - _node(body, node))
        aside = towards * [1.0, 1.0, 0.0]
        place_m = hook_m * aside / max(float(np.linalg.norm(aside)), 1e-9)
        place_m[2] = side * _half_m(body, strut)
        site = spec.body(f"strut{strut}").add_site(name=f"hook{number}.{node}", pos=place_m)
        tendon.wrap_site(site.name)


def _add_motor(spec: mujoco.MjSpec, number: int, strut: int) -> None:
    import mujoco

    spec.body(f"strut{strut}").add_site(name=f"motor{number}")
    for axis in (0, 1, 5):
        gear = [0.0] * 6
        gear[axis] = 1.0
        spec.add_actuator(trntype=mujoco.mjtTrn.mjTRN_SITE, target=f"motor{number}", gear=gear)


def _node(body: Body, node: int) -> Array:
    return np.array(body.nodes_m[node])


def _half_m(body: Body, strut: int) -> float:
    return float(np.linalg.norm(_node(body, 2 * strut) - _node(body, 2 * strut + 1))) / 2.0
