"""Opens the robot that was chosen: a twin in its condition, or hardware from its file."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from vvvaltr.controller.core.attending import Hand, StartPlace
from vvvaltr.controller.core.errors import NotUnderstood, one_line_errors
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.robot.choice import RobotChoice, option

if TYPE_CHECKING:
    from vvvaltr.twin.presets import Preset
    from vvvaltr.twin.robot import TwinRobot

_FORMER_SCATTER = "frequency"  # of runs that do not name theirs

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Rig:
    """A robot ready for trials.

    Args:
        robot: with guarded motors; to be closed after use.
        settings: how its trials are run unless something else is asked for.
        range_hz: the frequencies to search unless others are asked for.
        start: where it is put back to; None for a twin, which its scatter puts back, and where the file does not say.
        hand: what puts it back without a person; None for nothing.
    """

    robot: GuardedRobot
    settings: TrialSettings
    range_hz: tuple[float, float]
    start: StartPlace | None = None
    hand: Hand | None = None


def choose_robot(asked: dict[str, Any]) -> RobotChoice:
    """Return the complete choice for what was asked, keyed as in RobotChoice.

    Raises:
        UserError: there is no such robot, or its file cannot be read (NotUnderstood), or there is no such file.
    """
    name = asked.get("name", "planar")
    if not name.endswith(".toml"):
        with one_line_errors():
            usual = {"body": _twin(name).body, "law": "eccentric", "world": "flat", "damage": (), "scatter": "careful"}
            return _explicit(RobotChoice(**{**usual, **asked, "name": name}))
    if condition := [key for key in asked if key != "name"]:
        raise NotUnderstood(
            f"{option(condition[0])} sets the condition of a twin, and {name} is a real robot; leave it out"
        )
    from vvvaltr.controller.robot.robot_file import load_robot_file

    return RobotChoice(name=name, file=msgspec.to_builtins(load_robot_file(Path(name))))


def _twin(name: str) -> Preset:
    """Return the twin called ``name``. Raises ValueError if there is none."""
    from vvvaltr.twin.presets import TWINS

    if name not in TWINS:
        raise ValueError(f"{unknown('robot', name, TWINS)}, or name a robot's file, FILE.toml")
    return TWINS[name]


def _explicit(choice: RobotChoice) -> RobotChoice:
    """Return the choice of a twin with its world's gravity and friction written out."""
    from vvvaltr.twin.scatter import parse_scatter
    from vvvaltr.twin.world import parse_world

    world = parse_world(choice.world or "flat", choice.gravity_m_s2, choice.friction)
    parse_scatter(choice.scatter or _FORMER_SCATTER, _twin(choice.name).frequency_scatter)
    return msgspec.structs.replace(choice, gravity_m_s2=world.gravity_m_s2, friction=world.friction)


def open_rig(choice: RobotChoice, seed: int, lies: RestingPose | None = None) -> Rig:
    """Open the robot.

    Args:
        choice: which robot.
        seed: seed of all that scatters on a twin.
        lies: where a twin that is left where it stopped lies; None for the start of a run.

    Raises:
        UserError: the choice is impossible.
        DeviceError: the hardware does not answer as it should.
    """
    _LOG.info("opening %s", choice.name)
    with one_line_errors():
        return _open_twin(choice, seed, lies) if choice.is_twin else _open_hardware(choice)


def is_left(choice: RobotChoice) -> bool:
    """Return whether the robot is a twin that is left where it stopped, from trial to trial."""
    from vvvaltr.twin.scatter import parse_scatter

    if not choice.is_twin:
        return False
    return parse_scatter(choice.scatter or _FORMER_SCATTER, _twin(choice.name).frequency_scatter).left


def make_twin(choice: RobotChoice, seed: int, in_any_order: bool = False) -> TwinRobot:
    """Return the twin that ``choice`` describes, without a guard.

    Args:
        choice: which twin, and its condition.
        seed: seed of all that scatters.
        in_any_order: whether its trials may be made in any order: the robot is then put back for each.

    Raises:
        ValueError: there is no such twin, or its condition is impossible.
    """
    from vvvaltr.twin.scatter import TrackerNoise, parse_scatter
    from vvvaltr.twin.world import parse_world

    usual, position_m = TrackerNoise(), choice.tracker_noise_m
    share = 1.0 if position_m is None else position_m / usual.position_m
    preset = _twin(choice.name)
    scatter = parse_scatter(choice.scatter or _FORMER_SCATTER, preset.frequency_scatter)
    return preset.make(
        body=choice.body,
        world=parse_world(choice.world or "flat", choice.gravity_m_s2, choice.friction),
        damage=choice.damage or (),
        law=choice.law or "eccentric",
        seed=seed,
        scatter=scatter.put_back() if in_any_order else scatter,
        noise=TrackerNoise(share * usual.position_m, share * usual.angle_rad),
    )


def _open_twin(choice: RobotChoice, seed: int, lies: RestingPose | None) -> Rig:
    from vvvaltr.twin.engine import Start

    twin = make_twin(choice, seed)
    if lies is not None:
        twin.put_down(Start(*lies.position_m[:2], lies.yaw_rad))
    return Rig(GuardedRobot(twin, Limits(twin.max_hz)), TrialSettings(), twin.range_hz)


def _open_hardware(choice: RobotChoice) -> Rig:
    from vvvaltr.controller.robot.hardware import open_hardware
    from vvvaltr.controller.robot.robot_file import robot_file_from
    from vvvaltr.drivers.mocking.hand import AskedHand

    config = robot_file_from(choice.file or {}, choice.name)
    hand = AskedHand(config.hand.udp_port) if config.hand else None
    robot = GuardedRobot(open_hardware(config), config.limits)
    return Rig(robot, config.trial_settings, config.range_hz, config.start_place, hand)
