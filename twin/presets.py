"""The twins by name, each with its usual body, numbers and scatter."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from vvvaltr.controller.core.spelling import unknown
from vvvaltr.twin.bodies import Parts, make_body
from vvvaltr.twin.body import Body, ConstantForce, EccentricForce, ForceLaw, apply_damage
from vvvaltr.twin.engine import Engine
from vvvaltr.twin.robot import TwinRobot
from vvvaltr.twin.scatter import USUAL_NOISE, Scatter, TrackerNoise, parse_scatter
from vvvaltr.twin.world import PLAIN, World

_TIME_CONSTANTS = 3.0  # in which 95 % of a change are made


@dataclass(frozen=True, slots=True)
class Drive:
    """A force law of the motors, and the range of frequencies worth searching; a motor turns no faster than its end."""

    law: ForceLaw
    range_hz: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Preset:
    """A twin as it is shipped.

    Args:
        body: name of the usual body.
        parts: numbers of the bodies; ``make`` replaces their force law.
        drives: force laws by name.
        frequency_scatter: deviation of the motors' frequency in the scatter ``frequency``, that of version 0.1.
        make_engine: makes the physics of a body in a world at a time step in seconds, 0 for the engine's own.
    """

    body: str
    parts: Parts
    drives: Mapping[str, Drive]
    frequency_scatter: float
    make_engine: Callable[[Body, World, float], Engine]

    def make(
        self,
        body: str | None = None,
        world: World = PLAIN,
        damage: Sequence[str] = (),
        law: str = "eccentric",
        seed: int = 0,
        scatter: Scatter | str = "careful",
        time_step_s: float = 0.0,
        noise: TrackerNoise = USUAL_NOISE,
    ) -> TwinRobot:
        """Return a robot on this twin.

        Args:
            body: prism3 or icosahedron6; None for the twin's usual one.
            world: gravity, friction and ground.
            damage: what is broken, in the words of ``body.apply_damage``.
            law: force law of the motors, eccentric or constant; each has its own range of frequencies.
            seed: seed of the scatter.
            scatter: what differs from trial to trial; as text in the words of ``scatter.parse_scatter``.
            time_step_s: time step of the physics; 0 for the engine's own.
            noise: noise of the tracker.

        Raises:
            ValueError: the body, the law or the scatter is unknown, or the damage is impossible; one line.
            UserError: MuJoCo is missing.
            Diverged: the body cannot even be put down.
        """
        if law not in self.drives:
            raise ValueError(unknown("force law", law, self.drives))
        drive = self.drives[law]
        parts = replace(self.parts, law=drive.law, max_hz=drive.range_hz[1])
        if isinstance(scatter, str):
            scatter = parse_scatter(scatter, self.frequency_scatter)
        made = apply_damage(make_body(body or self.body, parts), damage)
        if scatter.spin_up_s:
            made = _spin_up_within(made, scatter.spin_up_s)
        engine = self.make_engine(made, world, time_step_s)
        return TwinRobot(engine, drive.range_hz, seed, scatter, noise)


def _spin_up_within(body: Body, duration_s: float) -> Body:
    """Return the body with motors that reach 95 % of their frequency within ``duration_s``, and stop as before."""
    motors = (
        replace(motor, spin_up_s=duration_s / _TIME_CONSTANTS, spin_down_s=motor.spin_up_s) for motor in body.motors
    )
    return replace(body, motors=tuple(motors))


def _make_planar_engine(body: Body, world: World, time_step_s: float) -> Engine:
    from vvvaltr.twin.planar.engine import PlanarEngine

    return PlanarEngine(body, world, time_step_s)


def _make_spatial_engine(body: Body, world: World, time_step_s: float) -> Engine:
    from vvvaltr.twin.spatial.engine import SpatialEngine

    return SpatialEngine(body, world, time_step_s)


PLANAR_DRIVES = {
    "eccentric": Drive(EccentricForce(3.5e-5), (4.0, 16.7)),
    "constant": Drive(ConstantForce(0.35), (5.0, 50.0)),
}

PLANAR_PARTS = Parts(
    total_kg=0.080,
    motor_kg=0.004,
    law=PLANAR_DRIVES["eccentric"].law,
    max_hz=PLANAR_DRIVES["eccentric"].range_hz[1],
    stiffness_n_m=200.0,
    damping_n_s_m=1.0,
    rest_share=0.55,
    radius_m=0.003,
    tension_only=False,
)

SPATIAL_DRIVES = {
    "eccentric": Drive(EccentricForce(1e-5), (5.0, 50.0)),
    # A fifth of the weight: with much more, three motors in phase lift the robot, and hopping beats every gait.
    "constant": Drive(ConstantForce(0.15), (5.0, 50.0)),
}

SPATIAL_PARTS = Parts(
    total_kg=0.078,
    motor_kg=0.004,
    law=SPATIAL_DRIVES["eccentric"].law,
    max_hz=SPATIAL_DRIVES["eccentric"].range_hz[1],
    stiffness_n_m=200.0,
    damping_n_s_m=0.4,
    rest_share=0.75,
    radius_m=0.004,
    tension_only=True,
    rotor_kg_m2=5e-8,
)

TWINS: Mapping[str, Preset] = {
    "planar": Preset("prism3", PLANAR_PARTS, PLANAR_DRIVES, 0.10, _make_planar_engine),
    "spatial": Preset("icosahedron6", SPATIAL_PARTS, SPATIAL_DRIVES, 0.05, _make_spatial_engine),
}
"""The twins that ``--robot`` names."""

planar_robot, spatial_robot = TWINS["planar"].make, TWINS["spatial"].make
