"""A robot that is watched is told of as one that is not."""

from collections.abc import Callable

import pytest
from scripted import ScriptedRobot

from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.core.values import Outcome, Photo, Pose
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.view.watching import WatchedRobot
from vvvaltr.drivers.links.remote_clock import RemoteClock

SETTINGS = TrialSettings(duration_s=2.0)


class Camera:
    """A tracker with a clock of its own that keeps a picture a trial."""

    def __init__(self, robot: ScriptedRobot) -> None:
        self._robot = robot
        self.clock = RemoteClock()
        self.clock.here_s(0.0, 7.0)

    def pose(self) -> Pose:
        return self._robot.pose()

    def take_photos(self) -> tuple[Photo, ...]:
        return (Photo(self._robot.t_s, b"picture"),)


class Exact:
    """A tracker without noise, of a robot that does not move."""

    is_exact = True

    def __init__(self, robot: ScriptedRobot) -> None:
        self._robot = robot

    def pose(self) -> Pose:
        return Pose(self._robot.t_s, (0.1, 0.0, 0.03))


class SeenBy(ScriptedRobot):
    """A scripted robot with another tracker."""

    def __init__(self, kind: type[Camera] | type[Exact]) -> None:
        super().__init__()
        self._tracker = kind(self)

    @property
    def tracker(self) -> Camera | Exact:  # type: ignore[override]
        return self._tracker


def test_pictures_and_clock_of_the_tracker_are_recorded_while_somebody_watches() -> None:
    trial = run_trial(WatchedRobot(SeenBy(Camera)), Gait((10.0, 8.0, 6.0)), SETTINGS)

    assert [photo.jpeg for photo in trial.photos] == [b"picture"]
    assert trial.conditions.tracker_offset_s == -7.0


@pytest.mark.parametrize("watched", [lambda robot: robot, WatchedRobot], ids=["unwatched", "watched"])
def test_a_tracker_without_noise_may_repeat_itself(watched: Callable[[Robot], Robot]) -> None:
    trial = run_trial(watched(SeenBy(Exact)), Gait((10.0, 8.0, 6.0)), SETTINGS)

    assert (trial.outcome, trial.reason) == (Outcome.COMPLETED, "")
