"""The verbs: protocols that devices, twins, optimisers and observers satisfy.

A backend satisfies a protocol by having its methods; nothing is inherited.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from vvvaltr.controller.core.gaits import Gait, Quantity
from vvvaltr.controller.core.records import Event, Fit, LoggedTrial, Told
from vvvaltr.controller.core.values import Estimate, MotorState, Photo, Pose, Recommendation, Structure, Suggestion


class MotorDriver(Protocol):
    """Motors of one robot, in one order, whatever lines they hang on."""

    @property
    def motor_count(self) -> int:
        """Number of motors."""
        ...

    @property
    def quantities(self) -> frozenset[Quantity]:
        """What of a gait the device can apply; most can only set frequencies."""
        ...

    def drive(self, gait: Gait, hold_s: float) -> None:
        """Apply ``gait`` now, and stop by yourself after ``hold_s`` unless told again.

        Raises:
            ValueError: another number of motors, or a quantity or value that the device cannot apply.
            DeviceError: the device failed.
        """
        ...

    def state(self) -> MotorState:
        """Return what the device applies, never the request.

        Raises:
            DeviceError: the device failed, a motor has a fault, or what is known is stale.
        """
        ...

    def stop(self) -> None:
        """Stop all motors now. Idempotent. Raises DeviceError if the device cannot be told."""
        ...

    def close(self) -> None:
        """Stop, then let go of the line. Idempotent."""
        ...


class Tracker(Protocol):
    """Knows where the robot is."""

    def pose(self) -> Pose:
        """Return the present pose.

        Raises:
            TrackingLost: there is none that is fresh and trustworthy. Never a stale or made-up pose.
        """
        ...


@runtime_checkable
class Photographer(Protocol):
    """A tracker that keeps some of its pictures, to be looked at later."""

    def take_photos(self) -> tuple[Photo, ...]:
        """Return the pictures since the last call, in order."""
        ...


class Clock(Protocol):
    """Time, as a dependency: waits on hardware, steps the physics on a twin."""

    def now_s(self) -> float:
        """Seconds on a clock that never goes back."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Let ``duration_s`` seconds pass."""
        ...


class Robot(Protocol):
    """Everything that a trial needs."""

    @property
    def motors(self) -> MotorDriver:
        """The motors."""
        ...

    @property
    def tracker(self) -> Tracker:
        """The tracker."""
        ...

    @property
    def clock(self) -> Clock:
        """The clock."""
        ...

    @property
    def structure(self) -> Structure | None:
        """How to draw the robot, where that is known."""
        ...

    def place(self, trial: int) -> None:
        """Make the robot ready for a trial: a twin starts afresh, a lost link is opened again. Raises DeviceError."""
        ...

    def carry_on(self, trial: int) -> None:
        """Make the robot ready for a trial that begins where the robot is. Raises DeviceError."""
        ...

    def close(self) -> None:
        """Stop the motors and let go of everything. Idempotent."""
        ...


@runtime_checkable
class Parkable(Protocol):
    """A robot that can let go of its motors for a while."""

    def park(self) -> None:
        """Stop the motors and let go of their lines, until ``place`` opens them again. Idempotent."""
        ...


class AskTell(Protocol):
    """Proposes gaits and learns from scores. It never runs a trial.

    Deterministic: the same seed and the same sequence of ``tell`` give the same ``ask``.
    """

    def ask(self) -> Suggestion:
        """Return the gait to try next."""
        ...

    def tell(self, gait: Gait, score: float) -> None:
        """Learn from one valid trial. Raises ValueError if the score is not finite."""
        ...


@runtime_checkable
class Optimizer(AskTell, Protocol):
    """An optimiser with a model. ``ask_tell.complete`` makes one of any ``AskTell``."""

    def recommend(self) -> Recommendation:
        """Return the gait with the best posterior mean.

        Raises:
            ValueError: nothing has been told yet; or, as NothingToRecommend, what has been told does not say.
        """
        ...

    def predict(self, gaits: Sequence[Gait]) -> tuple[Estimate, ...]:
        """Return what the model expects of the gaits' true scores. Raises ValueError before the first ``tell``."""
        ...

    def promising(self, count: int) -> tuple[Gait, ...]:
        """Return up to ``count`` gaits of great posterior mean, the recommended one first, none near another."""
        ...

    def improvement(self) -> float:
        """Return what the next suggestion is expected to gain, in the score's unit; infinite without a model."""
        ...


@runtime_checkable
class Fitting(Optimizer, Protocol):
    """An optimiser whose fits the log keeps, so that a resumed run need not repeat them."""

    def fit(self) -> Fit | None:
        """Return the fit after the last trial told; None where there is none."""
        ...

    def recall(self, history: Sequence[Told]) -> None:
        """Be told a whole history at once, in place of all that was told before.

        It continues with the same bits as after a ``tell`` for each trial. Raises ValueError as ``tell`` does.
        """
        ...


@runtime_checkable
class Listening(AskTell, Protocol):
    """An optimiser that learns from what a trial shows beside its score."""

    def tell_trial(self, told: Told) -> None:
        """Learn from one valid trial. Raises ValueError if the score is not finite."""
        ...


@runtime_checkable
class Skipping(Protocol):
    """An optimiser that proposes other gaits in place of those that the operator does not want to be driven."""

    def skip(self, gait: Gait) -> None:
        """Propose neither this gait nor one like it from now on. It holds for the whole run, whatever is told later."""
        ...


class Observer(Protocol):
    """Follows a run: a live view, a summary, a program that reads events.

    An observer that raises is told nothing more; the run goes on.
    """

    def on_trial(self, logged: LoggedTrial) -> None:
        """Take notice of a trial, which is in the log already."""
        ...

    def on_event(self, event: Event) -> None:
        """Take notice of what happened beside the trials."""
        ...
