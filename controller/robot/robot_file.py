"""A robot's file, `robot.toml`: lines, motors, tracker, arena, and how trials are run. See docs/hardware.md."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from vvvaltr.controller.core.document import load_document, typed
from vvvaltr.controller.core.errors import NotUnderstood
from vvvaltr.controller.loop.safety import Arena, Limits
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.drivers.links.curve import Curve
from vvvaltr.drivers.odrive.line import Firmware
from vvvaltr.drivers.qik.line import QikSettings
from vvvaltr.drivers.qik.protocol import GREATEST_BAUD, check_baud, check_commands

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]
Pause = Annotated[float, Meta(ge=0, le=3600)]
Points = tuple[tuple[Positive, Positive], ...]


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of the file."""


class _Motor(_Table, frozen=True, kw_only=True):
    """What every motor has.

    Args:
        max_hz: the greatest frequency in either sense of rotation.
        ramp_hz_s: the fastest change of frequency; 0 for any.
        curve: calibration, (command, Hz) points; empty for none.
    """

    max_hz: Positive
    ramp_hz_s: NotNegative = 0.0
    curve: Points = ()


class QikMotorTable(_Motor, frozen=True, kw_only=True):
    """A motor at an output (0 or 1) of the board with this device id."""

    board: Annotated[int, Meta(ge=0, le=127)]
    output: Literal[0, 1]


class OdriveMotorTable(_Motor, frozen=True, kw_only=True):
    """An axis by its CAN node, with its current limit in A; 0 for the one in the drive's configuration."""

    node: Annotated[int, Meta(ge=0, le=63)]
    max_a: NotNegative = 0.0


class NodeMotorTable(_Motor, frozen=True, kw_only=True):
    """A motor of a motor node; the node numbers them in the order of the file."""


class QikLineTable(_Table, frozen=True, kw_only=True, tag="qik", tag_field="driver"):
    """Pololu qik 2s9v1 boards on a serial line; see ``vvvaltr.drivers.qik.line.QikSettings``."""

    port: str
    baud: Annotated[int, Meta(ge=1200, le=GREATEST_BAUD)] = 19200
    motor: tuple[QikMotorTable, ...]
    eight_bit: bool = False
    crc: bool = False
    timeout: Annotated[int, Meta(ge=0, le=127)] = 1
    spin_up_s: NotNegative = 0.2
    spin_up_below: Annotated[int, Meta(ge=0, le=255)] = 25

    @property
    def settings(self) -> QikSettings:
        """How the boards are run. Raises ValueError."""
        return QikSettings(self.eight_bit, self.crc, self.timeout, self.spin_up_s, self.spin_up_below)


class OdriveLineTable(_Table, frozen=True, kw_only=True, tag="odrive", tag_field="driver"):
    """ODrive axes on a CAN bus; interface, channel, bitrate and options as python-can takes them."""

    interface: str = "socketcan"
    channel: str
    bitrate: Annotated[int, Meta(gt=0)] = 500_000
    firmware: Firmware = Firmware.NEW
    options: dict[str, bool | int | float | str] = {}
    motor: tuple[OdriveMotorTable, ...]


class NodeLineTable(_Table, frozen=True, kw_only=True, tag="node", tag_field="driver"):
    """A motor node on a serial line."""

    port: str
    baud: Annotated[int, Meta(gt=0)] = 460_800
    motor: tuple[NodeMotorTable, ...]


LineTable = QikLineTable | OdriveLineTable | NodeLineTable


class StreamTable(_Table, frozen=True, kw_only=True, tag="stream", tag_field="kind"):
    """A tracker that sends poses over UDP; the host is the address to listen on."""

    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)]
    age_limit_s: Positive = 0.2


class ArenaTable(_Table, frozen=True, kw_only=True):
    """Where the robot may be; a trial that leaves it ends."""

    x_m: tuple[float, float]
    y_m: tuple[float, float]


class TrialTable(_Table, frozen=True, kw_only=True):
    """How trials are run unless the command line says otherwise; see ``TrialSettings``."""

    duration_s: Annotated[float, Meta(ge=0.1, le=3600)] = 5.0
    settle_s: Pause = 0.3
    ramp_s: Pause = 0.2
    period_s: Annotated[float, Meta(gt=0, le=0.2)] = 0.04
    hold_s: Annotated[float, Meta(gt=0, le=1)] = 0.25
    heading_limit_rad: Positive = 1.0


class SearchTable(_Table, frozen=True, kw_only=True):
    """The frequencies to search; a negative one turns the other way."""

    low_hz: float
    high_hz: float


class RobotFile(_Table, frozen=True, kw_only=True):
    """The whole file. Motors are numbered in its order, over all lines.

    Args:
        line: the lines to the motors' devices.
        tracker: what knows where the robot is.
        search: the frequencies to search; by default all that the motors can do.
        arena: where the robot may be; None for everywhere.
        trial: how trials are run.
        body: what the robot is built like, for drawing it: ``prism3`` or ``icosahedron6``.
    """

    line: tuple[LineTable, ...]
    tracker: StreamTable
    search: SearchTable | None = None
    arena: ArenaTable | None = None
    trial: TrialTable = TrialTable()
    body: Literal["", "prism3", "icosahedron6"] = ""

    @property
    def motors(self) -> tuple[_Motor, ...]:
        """All motors, in order."""
        return tuple(motor for line in self.line for motor in line.motor)

    @property
    def limits(self) -> Limits:
        """What may be asked of the motors."""
        return Limits(tuple(motor.max_hz for motor in self.motors))

    @property
    def range_hz(self) -> tuple[float, float]:
        """The frequencies to search."""
        least_hz = min(self.limits.max_hz)
        return (self.search.low_hz, self.search.high_hz) if self.search else (-least_hz, least_hz)

    @property
    def trial_settings(self) -> TrialSettings:
        """How trials are run."""
        arena = Arena(self.arena.x_m, self.arena.y_m) if self.arena else None
        return TrialSettings(**msgspec.structs.asdict(self.trial), arena=arena)


def load_robot_file(path: Path) -> RobotFile:
    """Read a robot's file. Raises UserError: one line with the file, the key, its value and what is allowed."""
    return _checked(load_document(path, RobotFile), str(path))


def robot_file_from(content: Mapping[str, Any], name: str) -> RobotFile:
    """Return the plain ``content`` of a robot's file, as a run keeps it. Raises UserError."""
    return _checked(typed(content, RobotFile, name), name)


def _checked(robot: RobotFile, name: str) -> RobotFile:
    """Return ``robot`` if it makes sense as a whole. Raises NotUnderstood."""
    try:
        _check_motors(robot)
        _check_rest(robot)
    except ValueError as error:
        raise NotUnderstood(f"{name}: {error}") from None
    return robot


def _check_motors(robot: RobotFile) -> None:
    if not robot.motors:
        raise ValueError("line.motor is empty; a robot has one motor or more")
    for i, line in enumerate(robot.line, start=1):
        if not line.motor:
            raise ValueError(f"line[{i}].motor is empty; a line has one motor or more")
        if isinstance(line, QikLineTable):
            _check_qik(line, f"line[{i}]")
        places = set()
        for j, motor in enumerate(line.motor, start=1):
            key = f"line[{i}].motor[{j}]"
            place = _place(motor)
            if place in places:
                raise ValueError(f"{key} is where another motor is already: {place}")
            places.add(place or key)
            if motor.curve:
                _check_curve(motor, key)


def _place(motor: _Motor) -> str:
    match motor:
        case QikMotorTable():
            return f"board {motor.board}, output {motor.output}"
        case OdriveMotorTable():
            return f"node {motor.node}"
    return ""


def _check_curve(motor: _Motor, key: str) -> None:
    try:
        curve = Curve(motor.curve)
    except ValueError as error:
        raise ValueError(f"{key}.curve: {error}") from None
    if motor.max_hz > curve.highest_hz + 1e-9:
        raise ValueError(f"{key}.max_hz is {motor.max_hz:g}; allowed: up to {curve.highest_hz:g}, where its curve ends")


def _check_qik(line: QikLineTable, key: str) -> None:
    try:
        check_baud(line.baud, len(line.motor), line.settings.has_crc)
    except ValueError as error:
        raise ValueError(f"{key}.{error}") from None
    for j, motor in enumerate(line.motor, start=1):
        try:
            check_commands(motor.curve, line.eight_bit)
        except ValueError as error:
            raise ValueError(f"{key}.motor[{j}].curve: {error}") from None


def _check_rest(robot: RobotFile) -> None:
    low_hz, high_hz = robot.range_hz
    limit_hz = min(robot.limits.max_hz)
    if not low_hz < high_hz:
        raise ValueError(f"search.high_hz is {high_hz:g}; allowed: above search.low_hz, {low_hz:g}")
    for key, value in (("low_hz", low_hz), ("high_hz", high_hz)):
        if abs(value) > limit_hz + 1e-9:
            raise ValueError(f"search.{key} is {value:g}; allowed: -{limit_hz:g} to {limit_hz:g}, the motors' max_hz")
    if robot.trial.hold_s <= robot.trial.period_s:
        raise ValueError(f"trial.hold_s is {robot.trial.hold_s:g}; allowed: above period_s, {robot.trial.period_s:g}")
    for axis in ("x_m", "y_m"):
        if robot.arena and not getattr(robot.arena, axis)[0] < getattr(robot.arena, axis)[1]:
            raise ValueError(
                f"arena.{axis} is {list(getattr(robot.arena, axis))}; allowed: [low, high] with low < high"
            )
