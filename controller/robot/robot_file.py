"""A robot's file, `robot.toml`: lines, motors, tracker, arena, and how trials are run. See docs/hardware.md."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Union

import msgspec
from msgspec import Meta

from vvvaltr.controller.core.attending import StartPlace
from vvvaltr.controller.core.conditions import GREATEST_SPEED_M_S
from vvvaltr.controller.core.document import read_document, typed
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.plug_ins import Registry
from vvvaltr.controller.core.spelling import did_you_mean
from vvvaltr.controller.loop.plausibility import Plausibility, plausible_speed_m_s
from vvvaltr.controller.loop.putting_back import Placement
from vvvaltr.controller.loop.safety import Arena, Limits
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.registry import DRIVERS
from vvvaltr.drivers.table import Finite, LineTable, MotorTable, Positive, Table, TrackerTable
from vvvaltr.drivers.trackers.registry import TRACKERS

Pause = Annotated[float, Meta(ge=0, le=3600)]


class ArenaTable(Table, frozen=True, kw_only=True):
    """Where the robot may be; a trial that leaves it ends."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]


class StartTable(Table, frozen=True, kw_only=True):
    """Where the robot is put back to; see ``StartPlace``. Without ``yaw_rad`` any heading will do."""

    x_m: Finite = 0.0
    y_m: Finite = 0.0
    yaw_rad: Finite | None = None
    within_m: Positive = 0.03
    within_rad: Positive = 0.2


class HandTable(Table, frozen=True, kw_only=True):
    """Where the hand beside a mock's robot is asked, on this computer. ``vvvaltr mock`` writes it."""

    udp_port: Annotated[int, Meta(ge=1, le=65535)]


class TrialTable(Table, frozen=True, kw_only=True):
    """How trials are run unless the command line says otherwise; see ``TrialSettings``.

    ``max_speed_m_s`` is the greatest plausible speed of the robot; 0 for the one that follows from its motors.
    """

    duration_s: Annotated[float, Meta(ge=0.1, le=3600)] = 5.0
    settle_s: Pause = 0.3
    ramp_s: Pause = 0.2
    period_s: Annotated[float, Meta(gt=0, le=0.2)] = 0.04
    hold_s: Annotated[float, Meta(gt=0, le=1)] = 0.25
    heading_limit_rad: Annotated[float, Meta(gt=0)] = math.inf
    rest_s: Pause = 0.25
    max_speed_m_s: Annotated[float, Meta(ge=0, le=GREATEST_SPEED_M_S)] = 0.0


class SearchTable(Table, frozen=True, kw_only=True):
    """The frequencies to search; a negative one turns the other way."""

    low_hz: float
    high_hz: float


class RobotFile(Table, frozen=True, kw_only=True):
    """The whole file. Motors are numbered in its order, over all lines.

    Args:
        line: the lines to the motors' devices.
        tracker: what knows where the robot is.
        search: the frequencies to search; by default all that the motors can do.
        arena: where the robot may be; None for everywhere.
        start: where the robot is put back to; None for the middle of the arena.
        hand: what puts a mock's robot back; None where a person does.
        trial: how trials are run.
        body: what the robot is built like, for drawing it: ``prism3`` or ``icosahedron6``.
    """

    line: tuple[LineTable, ...]
    tracker: TrackerTable
    search: SearchTable | None = None
    arena: ArenaTable | None = None
    start: StartTable | None = None
    hand: HandTable | None = None
    trial: TrialTable = TrialTable()
    body: Literal["", "prism3", "icosahedron6"] = ""

    @property
    def motors(self) -> tuple[MotorTable, ...]:
        """All motors, in order."""
        return tuple(motor for line in self.line for motor in line.motor)

    @property
    def limits(self) -> Limits:
        """The limits of the motors."""
        return Limits(tuple(motor.max_hz for motor in self.motors))

    @property
    def range_hz(self) -> tuple[float, float]:
        """The frequencies to search."""
        least_hz = min(self.limits.max_hz)
        low_hz = -least_hz if self.reverses else 0.0
        return (self.search.low_hz, self.search.high_hz) if self.search else (low_hz, least_hz)

    @property
    def reverses(self) -> bool:
        """Whether all motors can turn both ways."""
        return all(line.reverses for line in self.line)

    @property
    def start_place(self) -> StartPlace | None:
        """Where the robot is put back to."""
        return StartPlace(**msgspec.structs.asdict(self.start)) if self.start else None

    @property
    def trial_settings(self) -> TrialSettings:
        """How trials are run."""
        settings = msgspec.structs.asdict(self.trial)
        max_speed_m_s = settings.pop("max_speed_m_s") or plausible_speed_m_s(max(self.limits.max_hz))
        arena = Arena(self.arena.x_m, self.arena.y_m) if self.arena else None
        return TrialSettings(**settings, arena=arena, plausibility=Plausibility(max_speed_m_s))


def load_robot_file(path: Path) -> RobotFile:
    """Read a robot's file. Raises UserError: one line with the file, the key, its value and what is allowed."""
    if not path.exists():
        raise UserError(f"{path}: there is no such file; vvvaltr init {path} writes a first one")
    robot = robot_file_from(read_document(path), str(path))
    return msgspec.structs.replace(robot, tracker=robot.tracker.located(path.parent))


def robot_file_from(content: Any, name: str) -> RobotFile:
    """Return the plain ``content`` of a robot's file, as a run keeps it, if it makes sense. Raises UserError."""
    robot = convert_robot_file(content, name)
    try:
        _check_motors(robot)
        _check_rest(robot)
    except ValueError as error:
        raise NotUnderstood(f"{name}: {error}") from None
    return robot


def convert_robot_file(content: Any, name: str) -> RobotFile:
    """Return the plain ``content`` of a robot's file, with the tables of its devices. Raises UserError."""
    found = content if isinstance(content, dict) else {}
    try:
        line = _table_types(found.get("line"), "driver", DRIVERS, "line[{}].driver")
        tracker = _table_types([found.get("tracker")], "kind", TRACKERS, "tracker.kind")
    except ValueError as error:
        raise NotUnderstood(f"{name}: {error}") from None
    # A device's keys are known once it has been named, so the type of the file depends on its content.
    kind = msgspec.defstruct(
        "RobotFile",
        [("line", tuple[Union[line], ...]), ("tracker", Union[tracker])],  # type: ignore[valid-type]  # noqa: UP007
        bases=(RobotFile,),
        frozen=True,
        kw_only=True,
    )
    return RobotFile(**msgspec.structs.asdict(typed(content, kind, name)))


def _table_types(tables: Any, field: str, registry: Registry[Any], key: str) -> tuple[type[Table], ...]:
    """Return the types that ``tables`` may have: the built-in ones and those of the plug-ins that they name.

    Raises ValueError for a name that nobody has added.
    """
    names = list(registry.built_in)
    for number, table in enumerate(tables if isinstance(tables, list | tuple) else (), start=1):
        name = table.get(field) if isinstance(table, dict) else None
        if isinstance(name, str) and name not in names:
            if name not in registry:
                allowed = ", ".join(map(repr, registry.names))
                guess = did_you_mean(name, registry.names)
                raise ValueError(f"{key.format(number)} is {name!r}{guess}; allowed: {allowed}")
            names.append(name)
    return tuple(registry.named(name).table for name in names)


def _check_motors(robot: RobotFile) -> None:
    if not robot.motors:
        raise ValueError("line.motor is empty; a robot has one motor or more")
    for number, line in enumerate(robot.line, start=1):
        if not line.motor:
            raise ValueError(f"line[{number}].motor is empty; a line has one motor or more")
        try:
            line.check()
        except ValueError as error:
            raise ValueError(f"line[{number}].{error}") from None
        _check_places(line, f"line[{number}]")


def _check_places(line: LineTable, key: str) -> None:
    places = set()
    for number, motor in enumerate(line.motor, start=1):
        if motor.place and motor.place in places:
            raise ValueError(f"{key}.motor[{number}] is at {motor.place}, where another motor is already")
        places.add(motor.place)
        if motor.curve:
            _check_curve(motor, f"{key}.motor[{number}]")


def _check_curve(motor: MotorTable, key: str) -> None:
    try:
        curve = Curve(motor.curve)
    except ValueError as error:
        raise ValueError(f"{key}.curve: {error}") from None
    if motor.max_hz > curve.highest_hz + 1e-9:
        raise ValueError(f"{key}.max_hz is {motor.max_hz:g}; allowed: up to {curve.highest_hz:g}, where its curve ends")


def _check_rest(robot: RobotFile) -> None:
    low_hz, high_hz = robot.range_hz
    limit_hz = min(robot.limits.max_hz)
    if not low_hz < high_hz:
        raise ValueError(f"search.high_hz is {high_hz:g}; allowed: above search.low_hz, {low_hz:g}")
    if low_hz < 0.0 and not robot.reverses:
        raise ValueError(f"search.low_hz is {low_hz:g}; allowed: 0 or more, since a motor of the robot turns one way")
    for key, value in (("low_hz", low_hz), ("high_hz", high_hz)):
        if abs(value) > limit_hz + 1e-9:
            raise ValueError(f"search.{key} is {value:g}; allowed: -{limit_hz:g} to {limit_hz:g}, the motors' max_hz")
    if robot.trial.hold_s <= robot.trial.period_s:
        raise ValueError(f"trial.hold_s is {robot.trial.hold_s:g}; allowed: above period_s, {robot.trial.period_s:g}")
    for axis in ("x_m", "y_m"):
        if robot.arena and not 0.0 < getattr(robot.arena, axis)[1] - getattr(robot.arena, axis)[0] < math.inf:
            raise ValueError(
                f"arena.{axis} is {list(getattr(robot.arena, axis))}; allowed: [low, high] with low < high, both finite"
            )
    if robot.start and Placement(arena=robot.trial_settings.arena).is_at_border(robot.start.x_m, robot.start.y_m):
        raise ValueError(
            f"start is at x_m {robot.start.x_m:g}, y_m {robot.start.y_m:g}; allowed: well inside the arena"
        )
