"""What differs between repeats of one gait on a twin, by its causes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any, Self

import numpy as np

from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.core.streams import stream
from vvvaltr.twin.engine import Start

LONGEST_DRIVE_S = 5.0  # a motor that stops within a trial does so before this

_WEAKEST = math.log(0.1)  # nobody goes on with a robot that is weaker than this
_LARGEST = {"incline_rad": 0.5} | dict.fromkeys(("not_starting", "stopping", "step", "step_factor", "frequency"), 1.0)


@dataclass(frozen=True, slots=True)
class Scatter:
    """The causes of scatter. Deviations are standard deviations of normal distributions with mean 0.

    Args:
        incline_rad: angle of the whole floor, which the tracker's frame follows.
        azimuth_rad: direction downhill, counter-clockwise from x; None to draw it from the seed.
        left: whether the robot is left where it stopped, from trial to trial, up to the border.
        border_m: distance of the border from the origin, along x and y; beyond it a robot that is left is put back.
        place_m: deviation of the start's x and of its y, where the robot is put down.
        heading_rad: deviation of the start's yaw; the planar twin has none.
        tilt_rad: deviation of the start's pitch.
        not_starting: probability that one of the motors does not start in a trial.
        stopping: probability that one of them stops within it, in its first 5 s.
        telling: whether the motors' device measures and tells their frequency, and with it a motor that stands still.
        drift: deviation of the change, from trial to trial, of the logarithm of the motors' force (springs, wear).
        step: probability that the force changes for good before a trial.
        step_factor: what such a change multiplies the force by.
        fade: what the logarithm of the force loses in each trial since the batteries were new.
        battery_trials: number of trials after which the batteries are new again; 0 for never.
        frequency: deviation of the logarithm of each motor's actual over its commanded frequency, fixed within a trial.
            The actual frequency still stays within the motor's limit.
        spin_up_s: time in which a motor reaches 95 % of its frequency; 0 for the body's own.

    Raises:
        ValueError: a number is out of range.
    """

    incline_rad: float = 0.0
    azimuth_rad: float | None = None
    left: bool = False
    border_m: float = 0.5
    place_m: float = 0.005
    heading_rad: float = 0.05
    tilt_rad: float = 0.02
    not_starting: float = 0.0
    stopping: float = 0.0
    telling: bool = True
    drift: float = 0.0
    step: float = 0.0
    step_factor: float = 0.8
    fade: float = 0.0
    battery_trials: int = 0
    frequency: float = 0.01
    spin_up_s: float = 1.0

    def __post_init__(self) -> None:
        if self.azimuth_rad is not None and not math.isfinite(self.azimuth_rad):
            raise ValueError(f"azimuth_rad is {self.azimuth_rad:g}; allowed: any angle")
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "azimuth_rad" or isinstance(value, bool):
                continue
            largest = _LARGEST.get(field.name, math.inf)
            if not (0.0 <= value <= largest and math.isfinite(value)):
                bound = f"0 to {largest:g}" if largest < math.inf else "0 or more"
                raise ValueError(f"{field.name} is {value:g}; allowed: {bound}")

    @classmethod
    def none(cls) -> Self:
        """Return no scatter: all trials of a gait are the same, but for the tracker's noise."""
        return cls(place_m=0.0, heading_rad=0.0, tilt_rad=0.0, frequency=0.0, spin_up_s=0.0)

    @classmethod
    def of_frequency(cls, deviation: float) -> Self:
        """Return the scatter of version 0.1: small errors of the start, and of each motor's frequency."""
        return cls(frequency=deviation, spin_up_s=0.0)

    def level(self) -> Scatter:
        """Return what remains where a speed is measured for truth.

        The floor is level, every start is fresh, all motors turn and have their full strength; the small errors of
        start and frequency and the spin-up remain, and are to be averaged over.
        """
        return Scatter(
            place_m=self.place_m,
            tilt_rad=self.tilt_rad,
            heading_rad=self.heading_rad,
            frequency=self.frequency,
            spin_up_s=self.spin_up_s,
        )

    def put_back(self) -> Scatter:
        """Return this scatter with the robot put back for every trial, so that trials can be made in any order."""
        return replace(self, left=False)

    def draw_start(self, random: np.random.Generator) -> Start:
        """Draw how the robot is put down."""
        return Start(*(random.normal(0.0, [self.place_m, self.place_m, self.heading_rad, self.tilt_rad]).tolist()))

    def draw_azimuth_rad(self, seed: int) -> float:
        """Return the direction downhill."""
        if self.azimuth_rad is not None:
            return self.azimuth_rad
        return float(stream(seed, 0, "floor").uniform(-math.pi, math.pi))

    def draw_failure(self, random: np.random.Generator, motors: int) -> tuple[int, float] | None:
        """Draw the motor that fails in a trial, as an index, and the time at which it does, in s of the drive."""
        chance, when, motor = float(random.random()), float(random.random()), int(random.integers(motors))
        if chance < self.not_starting:
            return motor, 0.0
        return (motor, when * LONGEST_DRIVE_S) if chance < self.not_starting + self.stopping else None

    def strength(self, seed: int, trial: int) -> float:
        """Return the motors' force in a trial over their full force, at most 1.

        The logarithm is minus the distance that a random walk is from its start, less the steps and what the batteries
        have lost.
        """
        if not (self.drift or self.step or self.fade):
            return 1.0
        draws = [_draw_change(seed, number) for number in range(2, trial + 1)]
        walk = self.drift * sum(stride for stride, _ in draws)
        steps = sum(chance < self.step for _, chance in draws)
        used = max(0, trial - 1)
        age = used % self.battery_trials if self.battery_trials else used
        logarithm = -abs(walk) + steps * math.log(max(self.step_factor, 0.01)) - self.fade * age
        return math.exp(max(_WEAKEST, logarithm))


@lru_cache(maxsize=8192)  # each trial asks for those of all trials before it
def _draw_change(seed: int, trial: int) -> tuple[float, float]:
    """Return the stride of the walk of strength before a trial, in deviations, and what decides whether it steps."""
    random = stream(seed, trial, "strength")
    return float(random.normal()), float(random.random())


@dataclass(frozen=True, slots=True)
class TrackerNoise:
    """The noise of each reading of a twin's tracker, which is no part of the robot's scatter.

    Args:
        position_m: standard deviation of each coordinate.
        angle_rad: standard deviation of each angle.
    """

    position_m: float = 0.0002
    angle_rad: float = 0.002

    @classmethod
    def none(cls) -> Self:
        """Return no noise: an exact tracker, which no laboratory has."""
        return cls(0.0, 0.0)


USUAL_NOISE = TrackerNoise()

CAREFUL = Scatter(drift=0.005)
"""The robot is put back to one pose on a level floor, and somebody sees to batteries and motors."""

HURRIED = Scatter(
    incline_rad=0.02,
    left=True,
    heading_rad=math.pi,
    not_starting=0.04,
    stopping=0.01,
    telling=False,
    drift=0.012,
    step=0.005,
    fade=0.003,
    battery_trials=25,
)
"""The robot is left where it stopped on a floor that is not quite level, and nobody looks at batteries and motors."""


def parse_scatter(text: str, usual_frequency: float) -> Scatter:
    """Return the scatter that the command line writes as ``careful`` or ``hurried:incline_rad=0.05,left=no``.

    Args:
        text: name of a preset, ``careful``, ``hurried``, ``none`` or ``frequency``, and settings that differ from it.
        usual_frequency: deviation of the twin's motors in the preset ``frequency``.

    Raises:
        ValueError: the text or a value is wrong; one line that names what is wrong and what is allowed.
    """
    kind, _, settings = text.partition(":")
    presets: Mapping[str, Scatter] = {
        "careful": CAREFUL,
        "hurried": HURRIED,
        "none": Scatter.none(),
        "frequency": Scatter.of_frequency(usual_frequency),
    }
    if kind not in presets:
        raise ValueError(unknown("scatter", kind, presets))
    try:
        return replace(presets[kind], **dict(_setting(part) for part in settings.split(",") if settings))
    except ValueError as error:
        raise ValueError(f"scatter {text!r}: {error}") from None


def _setting(text: str) -> tuple[str, Any]:
    """Return name and value of ``name=value``."""
    name, _, value = text.partition("=")
    usual = {field.name: field.default for field in fields(Scatter)}
    if name not in usual:
        raise ValueError(unknown("setting of scatter", name, usual))
    if isinstance(usual[name], bool):
        if value not in ("yes", "no"):
            raise ValueError(f"{name} is {value!r}; allowed: yes or no")
        return name, value == "yes"
    is_whole = isinstance(usual[name], int)
    try:
        return name, int(value) if is_whole else float(value)
    except ValueError:
        raise ValueError(f"{name} is {value!r}, which is not a {'whole ' * is_whole}number") from None
