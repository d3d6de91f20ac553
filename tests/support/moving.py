"""A robot that moves in front of a tracker's stand-in, and looks at what the tracker makes of it."""

import math
import threading
import time
from contextlib import contextmanager

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Pose

PERIOD_S = 0.005


def pose_at(t_s: float) -> Pose:
    """Where the robot is at a time: everywhere else at every other one, and turned about all axes."""
    return Pose(
        t_s, (0.3 * math.sin(t_s), 0.2 * math.cos(t_s), 0.03), 0.5 * t_s, 0.3 * math.sin(2 * t_s), 0.2 * math.cos(t_s)
    )


@contextmanager
def moving(sender, clock_ahead_s: float = 0.0):
    """Send poses 200 times a second; the sender's clock is ahead of ours."""
    ended = threading.Event()

    def send() -> None:
        while not ended.wait(PERIOD_S):
            pose = pose_at(time.monotonic())
            sender.send(Pose(pose.t_s + clock_ahead_s, pose.position_m, pose.yaw_rad, pose.pitch_rad, pose.roll_rad))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def seen(tracker) -> Pose | str:
    """Return the pose, or the reason for none."""
    try:
        return tracker.pose()
    except TrackingLost as lost:
        return str(lost)


def until(tracker, wanted, within_s: float = 8.0) -> Pose | str:
    """Return the first pose, or reason for none, for which ``wanted`` holds."""
    deadline_s = time.monotonic() + within_s
    while time.monotonic() < deadline_s:
        last = seen(tracker)
        if wanted(last):
            return last
        time.sleep(0.002)
    raise AssertionError(f"still {last}")


def is_pose(what) -> bool:
    """Whether something is seen."""
    return isinstance(what, Pose)


def says(words: str):
    """Return a test whether a reason has these words."""
    return lambda what: isinstance(what, str) and words in what


def assert_true(pose: Pose, late_s: float = 0.1) -> None:
    """Check that a pose is where the robot was at the time that it tells."""
    times_s = [pose.t_s - late_s + 0.001 * step for step in range(round(1000 * late_s) + 2)]
    truth = min((pose_at(t_s) for t_s in times_s), key=lambda true: math.dist(true.position_m, pose.position_m))
    assert math.dist(truth.position_m, pose.position_m) < 5e-4
    turns = (pose.yaw_rad - truth.yaw_rad, pose.pitch_rad - truth.pitch_rad, pose.roll_rad - truth.roll_rad)
    assert all(abs(math.remainder(turn, math.tau)) < 2e-3 for turn in turns)
