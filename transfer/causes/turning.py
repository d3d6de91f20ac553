"""Whether each motor turned in a drive, from the shaking that a fast tracker sees.

A motor that turns at f shakes the robot at f. At the frequency at which the tracker sees it (folded, where f is above
half the tracker's rate) the amplitude spectrum of the pose has a line. Its height is measured over the noise next to
it, as the mean over all coordinates of (line / median)^2. A motor without a line stood still only if the tracker would
have seen it: the lines of the other motors, put in its place, must be well above the noise there. A line elsewhere near
its frequency means that it turns otherwise than commanded. A line where those of other motors mix, for the ground's
forces are not linear, may be theirs: at sums and differences of up to three of their frequencies. In all other cases
nothing can be told.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.values import Pose

LEAST_RATE_HZ = 45.0
"""Rate of poses below which nothing is told: lines of different motors would fold onto each other and onto the walk."""

LEAST_HZ = 8.0
"""Commanded frequency below which nothing is told: the robot's walk has the same frequencies."""

_SPUN_UP_S = 1.0
_LEAST_S = 2.0  # of the drive after it
_MOST_S = 20.0  # at its end: the time that a spectrum takes grows with the square of the drive's
_ROWS = 256  # of waves at a time, for the sake of memory
_BAND = 0.04  # share by which a motor may miss its frequency
_WIDE, _WIDE_HZ = 0.25, 4.0  # what is next to a line, as a share of its frequency and at least
_GUARD_HZ = 0.5  # width of a line to either side
_FINE = 0.4  # of the spectrum's resolution
_LEAST_SEEN_HZ = 3.0  # folded frequency below which the walk hides a line
_LEAST_PLACES = 8  # that tell the noise
_LEVER_M = 0.05  # angles count as the way of a point so far from the centre
_LINE = 6.0  # height at which there is a line
_MIXED_HZ = 0.3  # from a mixture of other lines: the spectrum's resolution in a drive of 5 s
_MIXTURES = ((2, 0), (3, 0), (1, 1), (1, -1), (2, 1), (2, -1))
_VISIBLE = 3.0  # how many times higher the other motors' lines must be


@dataclass(frozen=True, slots=True)
class _Spectrum:
    """Amplitudes (f, c) of the coordinates, in m, at frequencies (f,)."""

    rate_hz: float
    frequency_hz: Array
    amplitude_m: Array

    def fold(self, low_hz: float, high_hz: float) -> tuple[float, float]:
        """Return the range of frequencies at which the tracker sees those of a range."""
        seen = np.abs(np.linspace(low_hz, high_hz, 50)) % self.rate_hz
        seen = np.minimum(seen, self.rate_hz - seen)
        return float(seen.min()), float(seen.max())

    def unfold(self, seen_hz: float, near_hz: float) -> float:
        """Return the frequency next to ``near_hz`` that is seen at ``seen_hz``."""
        turns = np.arange(np.ceil(near_hz / self.rate_hz) + 1.0) * self.rate_hz
        possible = np.concatenate([turns + seen_hz, turns - seen_hz])
        return float(possible[np.abs(possible - near_hz).argmin()])

    def within(self, band: tuple[float, float], guard_hz: float) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Return which frequencies, (f,), lie in a band or next to it."""
        return np.asarray((self.frequency_hz >= band[0] - guard_hz) & (self.frequency_hz <= band[1] + guard_hz))


@dataclass(frozen=True, slots=True)
class _Line:
    """What the spectrum has where a motor should show.

    Args:
        frequency_hz: of the highest line in its band, unfolded.
        height: of it.
        wandering: of the highest line next to the band.
        amplitude_m: of the line in each coordinate, (c,).
        noise_m: of each coordinate next to the band, (c,).
    """

    frequency_hz: float
    height: float
    wandering: float
    amplitude_m: Array
    noise_m: Array


def find_turning(poses: Sequence[Pose], frequency_hz: Sequence[float]) -> tuple[bool | None, ...]:
    """Return for each motor whether it turned; None where the poses do not tell.

    Motors whose frequencies look alike to the tracker are tested together: it can be told that none of them turned.

    Args:
        poses: of the drive.
        frequency_hz: commanded frequencies.
    """
    spectrum = _measure(poses)
    motors = range(len(frequency_hz))
    if spectrum is None:
        return tuple(None for _ in motors)
    bands = [spectrum.fold((1.0 - _BAND) * abs(hz), (1.0 + _BAND) * abs(hz)) for hz in frequency_hz]
    alike = [[other for other in motors if _overlap(bands[motor], bands[other])] for motor in motors]
    lines = [_find_line(spectrum, abs(frequency_hz[motor]), bands, alike[motor]) for motor in motors]
    return tuple(_judge(spectrum, lines, motor, len(alike[motor]) > 1) for motor in motors)


def _judge(spectrum: _Spectrum, lines: Sequence[_Line | None], motor: int, is_shared: bool) -> bool | None:
    """Return whether a motor turned; a line that others may have made says nothing."""
    line = lines[motor]
    if line is None:
        return None
    others = [other for other in lines if other is not None and other is not line and other.height >= _LINE]
    if line.height >= _LINE:
        return None if is_shared or _is_mixed(spectrum, line, others) else True
    if not others or line.wandering >= _LINE:
        return None
    expected = [float(np.mean((other.amplitude_m / line.noise_m) ** 2)) for other in others]
    return False if min(expected) >= _VISIBLE * _LINE else None


def _is_mixed(spectrum: _Spectrum, line: _Line, others: Sequence[_Line]) -> bool:
    """Return whether other lines mix where a line is seen."""
    seen_hz = spectrum.fold(line.frequency_hz, line.frequency_hz)[0]
    mixed_hz = (
        a * one.frequency_hz + b * other.frequency_hz for one in others for other in others for a, b in _MIXTURES
    )
    return any(abs(spectrum.fold(hz, hz)[0] - seen_hz) < _MIXED_HZ for hz in mixed_hz)


def _measure(poses: Sequence[Pose]) -> _Spectrum | None:
    """Return the spectrum of a drive once the motors have spun up; None where it is too short or too slow."""
    begin_s = max(_SPUN_UP_S, poses[-1].t_s - _MOST_S) if poses else 0.0
    late = (pose for pose in poses if pose.t_s >= begin_s and pose.is_finite)
    seen = list({pose.t_s: pose for pose in late}.values())  # what was read twice, of a slow tracker, counts once
    times_s = np.array([pose.t_s for pose in seen])
    if len(seen) < 2 or times_s[-1] - times_s[0] < _LEAST_S:
        return None
    rate_hz = 1.0 / max(float(np.median(np.diff(times_s))), 1e-9)
    if not LEAST_RATE_HZ <= rate_hz < 1e4:
        return None
    angles_rad = np.unwrap([(pose.yaw_rad, pose.pitch_rad, pose.roll_rad) for pose in seen], axis=0)
    columns = [np.array([pose.position_m for pose in seen]), _LEVER_M * angles_rad]
    if len({len(pose.markers_m) for pose in seen}) == 1:
        columns.append(np.array([pose.markers_m for pose in seen]).reshape(len(seen), -1))
    coordinates = np.concatenate(columns, axis=1)
    coordinates = coordinates[:, np.ptp(coordinates, axis=0) > 0.0]
    if not coordinates.size:
        return None
    span_s = float(times_s[-1] - times_s[0])
    walk = np.polynomial.legendre.legvander(2.0 * (times_s - times_s[0]) / span_s - 1.0, 3)
    coordinates = coordinates - walk @ np.linalg.lstsq(walk, coordinates, rcond=None)[0]
    window = np.hanning(len(seen) + 2)[1:-1]
    frequency_hz = np.arange(_LEAST_SEEN_HZ - _GUARD_HZ, rate_hz / 2.0, _FINE / span_s)
    windowed = window[:, None] * coordinates
    blocks = (frequency_hz[row : row + _ROWS] for row in range(0, len(frequency_hz), _ROWS))
    lines = [np.abs(np.exp(-2j * np.pi * np.outer(block, times_s)) @ windowed) for block in blocks]
    return _Spectrum(rate_hz, frequency_hz, np.concatenate(lines) * 2.0 / float(window.sum()))


def _find_line(
    spectrum: _Spectrum, hz: float, bands: Sequence[tuple[float, float]], alike: Sequence[int]
) -> _Line | None:
    """Return what there is of a motor at a commanded frequency; None where the tracker cannot see it there."""
    own = (min(bands[motor][0] for motor in alike), max(bands[motor][1] for motor in alike))
    if hz < LEAST_HZ or own[0] < _LEAST_SEEN_HZ:
        return None
    middle_hz = 0.5 * (own[0] + own[1])
    wide_hz = max(_WIDE * middle_hz, _WIDE_HZ)
    inside = spectrum.within(own, 0.5 * _GUARD_HZ)
    near = spectrum.within((middle_hz - wide_hz, middle_hz + wide_hz), 0.0) & ~spectrum.within(own, _GUARD_HZ)
    for motor, band in enumerate(bands):
        if motor not in alike:
            near &= ~spectrum.within(band, 1.5 * _GUARD_HZ)
    if near.sum() < _LEAST_PLACES or not inside.any():
        return None
    noise_m = np.maximum(np.median(spectrum.amplitude_m[near], axis=0), 1e-12)
    heights = ((spectrum.amplitude_m / noise_m) ** 2).mean(axis=1)
    at = int(np.flatnonzero(inside)[heights[inside].argmax()])
    found_hz = spectrum.unfold(float(spectrum.frequency_hz[at]), hz)
    return _Line(found_hz, float(heights[at]), float(heights[near].max()), spectrum.amplitude_m[at], noise_m)


def _overlap(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return one[0] - _GUARD_HZ < other[1] and other[0] - _GUARD_HZ < one[1]
