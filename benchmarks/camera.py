"""How well and how fast the overhead camera sees a twin's run, and that it never sees what is not there.

Pictures are rendered: 1280 x 720, 65 degrees wide, from 1 m above the floor and askew by 3 degrees, of a tag of 40 mm
at 60 mm height, with the lens' distortion, blur of 1.5 px, noise of 2 %, uneven light, and the motion blur of 4 ms.
Times are processor times, because the processor is shared.

python -m benchmarks.camera --json
"""

from __future__ import annotations

import argparse
import bisect
import json
import math
import random
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vvvaltr.controller.core.errors import TrackingLost
from vvvaltr.controller.core.values import Gait, Pose, Vector
from vvvaltr.drivers.trackers.camera.feed import FLOOR_M, LENS, TAG, make_feed, mock_view
from vvvaltr.drivers.trackers.camera.pictures import Looks, Painter, board_picture
from vvvaltr.drivers.trackers.camera.sight import Sight, Unseen
from vvvaltr.drivers.trackers.camera.table import CameraTable
from vvvaltr.drivers.trackers.camera.view import View

if TYPE_CHECKING:
    from vvvaltr.drivers.trackers.camera.lens import Lens
    from vvvaltr.drivers.trackers.registry import PoseFeed

PERIOD_S = 1.0 / 30.0
TRIAL_S = 5.0
WITHIN_M = (0.42, 0.22)  # of the picture's middle
_MOCK = """
import sys
from benchmarks.camera import note_truth
from vvvaltr.controller.cli.main import main
note_truth(sys.argv[1])
sys.exit(main(["mock", "qik", "--tracker", "camera", "--link", sys.argv[2]]))
"""


@dataclass(frozen=True, slots=True)
class Moving:
    """A moment of a run: where the robot is, and how fast it moves."""

    pose: Pose
    velocity_m_s: Vector


def trial(seed: int, duration_s: float = TRIAL_S) -> list[Moving]:
    """Return a spatial twin's trial, picture by picture: at a random place, in a random heading, with a random gait."""
    from vvvaltr.twin.presets import TWINS
    from vvvaltr.twin.scatter import Scatter

    dice = random.Random(seed)
    aside = tuple(dice.uniform(-within, within) for within in WITHIN_M)
    heading_rad = dice.uniform(-math.pi, math.pi)
    robot = TWINS["spatial"].make(scatter=Scatter.none())
    robot.place(seed)
    rest_z_m = robot.tracker.pose().position_m[2]
    gait = Gait(tuple(dice.uniform(20.0, 45.0) for _ in range(robot.motors.motor_count)))
    moments, step_s = [], 0.001
    for number in range(round(duration_s / PERIOD_S) + 1):
        before = robot.tracker.pose()
        robot.motors.drive(gait if 0 < number * PERIOD_S < duration_s - 0.3 else gait.scaled(0.0), 1.0)
        robot.clock.sleep(step_s)
        after = robot.tracker.pose()
        moments.append(_placed(before, after, step_s, aside, heading_rad, rest_z_m))
        robot.clock.sleep(PERIOD_S - step_s)
    robot.close()
    return moments


def _placed(
    before: Pose, after: Pose, step_s: float, aside: tuple[float, ...], heading_rad: float, rest_z_m: float
) -> Moving:
    c, s = math.cos(heading_rad), math.sin(heading_rad)

    def turned(vector: Vector) -> Vector:
        return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]

    x_m, y_m, z_m = turned(before.position_m)
    position_m = (x_m + aside[0], y_m + aside[1], z_m - rest_z_m + TAG.height_m)
    x, y, z = ((here - there) / step_s for here, there in zip(after.position_m, before.position_m, strict=True))
    return Moving(replace(before, position_m=position_m, yaw_rad=before.yaw_rad + heading_rad), turned((x, y, z)))


def read_all(sight: Sight, painter: Painter, moments: list[Moving]) -> Iterator[tuple[Moving, Any, float]]:
    """Yield each moment with what the camera sees of it, None for nothing, and the processor time that it took in s."""
    for moment in moments:
        picture = painter.picture(moment.pose, moment.velocity_m_s)
        began_s = time.process_time()
        try:
            seen = sight.read(picture)
        except Unseen:
            seen = None
        yield moment, seen, time.process_time() - began_s


def precision(view: View, trials: list[list[Moving]], looks: Looks) -> dict[str, Any]:
    """Return the errors of position, yaw and displacement of a camera known as ``view``, and its time for a picture."""
    painter, sight = Painter(mock_view(), TAG, FLOOR_M, looks=looks), Sight(view, TAG)
    off_mm, off_deg, displacement_mm, times_s, seen_count = [], [], [], [], 0
    for moments in trials:
        looks_at = list(read_all(sight, painter, moments))
        seen = [(moment.pose, found) for moment, found, _ in looks_at if found is not None]
        seen_count += len(seen)
        times_s += [spent_s for _, _, spent_s in looks_at]
        off_mm += [1000.0 * math.dist(pose.position_m[:2], (found.x_m, found.y_m)) for pose, found in seen]
        off_deg += [abs(math.degrees(math.remainder(found.yaw_rad - pose.yaw_rad, math.tau))) for pose, found in seen]
        if len(seen) > 1:
            displacement_mm.append(1000.0 * _displacement_error_m(seen[0], seen[-1]))
    return {
        "seen": round(seen_count / sum(map(len, trials)), 4),
        "position_mm": quantiles(off_mm),
        "yaw_deg": quantiles(off_deg),
        "displacement_mm": quantiles(displacement_mm),
        "picture_ms": round(1000.0 * statistics.median(times_s), 2),
    }


def _displacement_error_m(first: tuple[Pose, Any], last: tuple[Pose, Any]) -> float:
    true = np.subtract(last[0].position_m[:2], first[0].position_m[:2])
    seen = np.subtract((last[1].x_m, last[1].y_m), (first[1].x_m, first[1].y_m))
    return float(np.hypot(*(true - seen)))


def quantiles(values: list[float]) -> list[float] | None:
    """Return the median, 95 % and 99 % of ``values``; None if there are none."""
    return np.quantile(values, [0.5, 0.95, 0.99]).round(3).tolist() if values else None


def calibrated_view(views: int = 15) -> View:
    """Return the camera as it is known from board views and floor tags that were rendered as badly as all else."""
    from vvvaltr.drivers.trackers.camera.board import BOARD_CELL_MM, BoardViews, board_cells, calibrated
    from vvvaltr.drivers.trackers.camera.setup import find_view

    collected, seed = BoardViews(), 0
    while len(collected.views) < views:
        seed += 1
        rotation, position_m = _board_place(np.random.default_rng(seed))
        collected.add(board_picture(LENS, board_cells(), BOARD_CELL_MM / 1000.0, rotation, position_m, Looks(), seed))
    lens: Lens = calibrated(collected).lens
    painter = Painter(mock_view(), TAG, FLOOR_M, seed=1)
    return find_view(lens, TAG, FLOOR_M, 0.0, lambda: painter.picture(None))


def _board_place(dice: np.random.Generator) -> tuple[Any, Any]:
    import cv2

    rotation, _ = cv2.Rodrigues(dice.uniform(-0.6, 0.6, 3))
    away_m = dice.uniform(0.3, 0.5)
    return rotation, np.array([*(dice.uniform(-0.4, 0.4, 2) * [away_m, 0.5 * away_m]), away_m])


def full_frame_ms(pictures: int = 60) -> float:
    """Return the median time to find the robot anywhere in a picture."""
    painter, times_s = Painter(mock_view(), TAG, FLOOR_M), []
    for number in range(pictures):
        picture = painter.picture(
            Pose(0.0, (0.4 * math.sin(number), 0.2 * math.cos(number), TAG.height_m), 0.1 * number)
        )
        sight = Sight(mock_view(), TAG)
        began_s = time.process_time()
        sight.read(picture)
        times_s.append(time.process_time() - began_s)
    return round(1000.0 * statistics.median(times_s), 2)


@dataclass(slots=True)
class _Told:
    """What the feed is told: where the robot is, or nothing; noted before, and with the time at which it was sent."""

    noted_s: float
    place_m: tuple[float, float] | None
    sent_s: float = math.inf


class Shown(threading.Thread):
    """Tells a feed 50 poses a second: of a robot that shakes and creeps, or that a hand hides it."""

    def __init__(self, feed: PoseFeed) -> None:
        super().__init__(daemon=True)
        self._feed = feed
        self.is_hidden = False
        self.is_over = threading.Event()
        self.told: list[_Told] = []

    @staticmethod
    def place(t_s: float) -> tuple[float, float]:
        """Return where the robot is at ``t_s``."""
        return 0.2 * math.sin(0.2 * t_s) + 0.001 * math.sin(60.0 * t_s), 0.1 * math.cos(0.3 * t_s)

    def run(self) -> None:
        """Tell poses until it is over."""
        while not self.is_over.wait(0.02):
            now_s = time.monotonic()
            place = None if self.is_hidden else self.place(now_s)
            self.told.append(told := _Told(now_s, place))
            if place is None:
                self._feed.send_lost(now_s)
            else:
                self._feed.send(Pose(now_s, (*place, 0.04), 0.3))
            told.sent_s = time.monotonic()

    def hide(self) -> None:
        """Hide the robot, and return once that has been told."""
        self.is_hidden = True
        while self.told[-1].place_m is not None or self.told[-1].sent_s == math.inf:
            time.sleep(0.002)

    def is_true(self, pose: Pose) -> bool:
        """Whether the robot was to be seen, and there, at the time of ``pose``: pictures show what was told last."""
        last = bisect.bisect_right(self.told, pose.t_s, key=lambda each: each.noted_s) - 1
        while last > 0 and not self._is_at(self.told[last], pose) and self.told[last].sent_s > pose.t_s:
            last -= 1  # this one was noted, and not yet told
        return self._is_at(self.told[max(0, last)], pose)

    @staticmethod
    def _is_at(told: _Told, pose: Pose) -> bool:
        return told.place_m is not None and math.dist(told.place_m, pose.position_m[:2]) < 0.001


def occlusions(count: int) -> dict[str, Any]:
    """Hide the robot ``count`` times for longer than the age limit: in real time, through the tracker's process."""
    from vvvaltr.drivers.trackers.camera.tracker import CameraTracker

    dice, lost, untrue, looks = random.Random(0), 0, 0, 0
    mock = make_feed()
    table = mock.table
    assert isinstance(table, CameraTable)
    shown = Shown(mock.feed)
    shown.start()
    try:
        with closing(CameraTracker(table)) as tracker:
            for _ in range(count):
                _until_seen(tracker)
                shown.hide()
                ends_s = time.monotonic() + table.age_limit_s + dice.uniform(0.1, 0.3)
                found = _watch(tracker, ends_s)
                looks += len(found)
                lost += found[-1] is None
                untrue += sum(pose is not None and not shown.is_true(pose) for pose in found)
                shown.is_hidden = False
    finally:
        shown.is_over.set()
        shown.join()
        mock.feed.close()
    return {"occlusions": count, "lost": lost, "held_or_invented": untrue, "looks": looks}


def set_points(duration_s: float) -> dict[str, float]:
    """Return the longest time between two set-points at a qik board in ms, with no camera and then with one.

    The controller's process learns without a pause, as in ``benchmarks.hil``. The mock's camera, which draws 50
    pictures a second, takes more of the machine than a real one.
    """
    from benchmarks.hil import measure_longest_gaps
    from benchmarks.observed import ObservedDevice
    from vvvaltr.controller.robot.hardware import open_hardware
    from vvvaltr.controller.robot.robot_file import load_robot_file
    from vvvaltr.drivers.trackers.camera.tracker import CameraTracker

    figures = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        ObservedDevice("qik", Path(folder, "qik")) as device,
        closing(open_hardware(load_robot_file(device.robot_file))) as robot,
    ):
        gaps = measure_longest_gaps([device], [robot], duration_s)
        figures["without_camera_ms"] = gaps["set_point_longest_gap_ms"]
        mock = make_feed()
        assert isinstance(mock.table, CameraTable)
        shown = Shown(mock.feed)
        shown.start()
        with closing(CameraTracker(mock.table)):
            gaps = measure_longest_gaps([device], [robot], duration_s)
            figures["with_camera_ms"] = gaps["set_point_longest_gap_ms"]
            figures["device_longest_pause_ms"] = gaps["device_longest_pause_ms"]
        shown.is_over.set()
        shown.join()
        mock.feed.close()
    return {name: round(figure, 2) for name, figure in figures.items()}


def _until_seen(tracker: Any) -> None:
    ends_s = time.monotonic() + 30.0
    while True:
        try:
            tracker.pose()
            return
        except TrackingLost:
            if time.monotonic() > ends_s:
                raise
        time.sleep(0.01)


def _watch(tracker: Any, ends_s: float) -> list[Pose | None]:
    found: list[Pose | None] = []
    is_last = False
    while not is_last:
        is_last = time.monotonic() > ends_s  # the last look comes after the end, however busy the machine is
        try:
            found.append(tracker.pose())
        except TrackingLost:
            found.append(None)
        time.sleep(0.01)
    return found


def note_truth(path: str) -> None:
    """Make the mock of this process write down each pose that it shows to the camera: time, x and y."""
    import vvvaltr.drivers.trackers.camera as camera
    from vvvaltr.drivers.trackers.registry import MockFeed

    file = Path(path).open("w", buffering=1, encoding="utf-8")  # noqa: SIM115  as long as the process lives

    def teed() -> MockFeed:
        mock = make_feed()
        send = mock.feed.send

        def noted(pose: Pose) -> None:
            file.write(f"{pose.t_s!r} {pose.position_m[0]!r} {pose.position_m[1]!r}\n")
            send(pose)

        mock.feed.send = noted  # type: ignore[method-assign]
        return mock

    camera.TRACKER = replace(camera.TRACKER, make_feed=teed)


def learning(trials: int = 8) -> dict[str, Any]:
    """Run ``vvvaltr learn`` on a mock that is seen by the camera, and compare each displacement with the twin's."""
    with tempfile.TemporaryDirectory() as folder:
        truth, link, run = (str(Path(folder, name)) for name in ("truth", "qik", "run"))
        mock = subprocess.Popen(
            [sys.executable, "-c", _MOCK, truth, link], stdout=subprocess.PIPE, stdin=subprocess.DEVNULL
        )
        assert mock.stdout is not None
        mock.stdout.readline()
        reader = threading.Thread(target=mock.stdout.read, daemon=True)
        reader.start()
        try:
            command = [
                "learn",
                "--robot",
                f"{link}.toml",
                "--trials",
                str(trials),
                "--out",
                run,
                "--no-recording",
                "--json",
            ]
            program = "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main(sys.argv[1:]))"
            subprocess.run([sys.executable, "-c", program, *command], check=True, stdout=subprocess.DEVNULL)
        finally:
            mock.terminate()
            mock.wait()
        return _compared(Path(run), np.loadtxt(truth))


def _compared(run: Path, truth: Any) -> dict[str, Any]:
    from vvvaltr.controller.runs.log import read_run

    offset_s = time.time() - time.monotonic()
    pairs = []
    for logged in read_run(run).trials:
        poses = [pose for pose in logged.trial.poses if pose.t_s >= 0.0]
        if not logged.trial.outcome.is_valid:
            continue
        rows = _matched(truth, np.array([pose.t_s for pose in poses]), logged.trial.started_unix_s - offset_s)
        seen = np.subtract(poses[-1].position_m[:2], poses[0].position_m[:2])
        pairs.append(
            (
                float(np.hypot(*seen)),
                float(np.hypot(*(rows[-1] - rows[0]))),
                float(np.hypot(*(seen - rows[-1] + rows[0]))),
            )
        )
    good = sum(abs(seen - true) <= max(0.001, 0.03 * true) for seen, true, _ in pairs)
    shown = [
        {"seen_mm": round(1e3 * seen, 2), "true_mm": round(1e3 * true, 2), "off_mm": round(1e3 * off, 2)}
        for seen, true, off in pairs
    ]
    return {"valid_trials": len(pairs), "within_1_mm_or_3_percent": good, "displacements": shown}


def _matched(truth: Any, times_s: Any, began_s: float) -> Any:
    """Return the true places at a trial's poses: a log keeps their distances in time, to the microsecond.

    A picture that the camera took while the mock told nothing shows what was told last: its time is not in the truth.
    """
    best, most = None, 0
    for start in np.flatnonzero(np.abs(truth[:, 0] - began_s) < 2.0):
        wanted = truth[start, 0] + times_s - times_s[0]
        rows = np.clip(np.searchsorted(truth[:, 0], wanted + 1e-4) - 1, 0, len(truth) - 1)
        matching = int(np.sum(np.abs(truth[rows, 0] - wanted) < 1e-5))
        if matching > most:
            best, most = truth[rows, 1:], matching
    if best is None or most < 0.5 * len(times_s):
        raise ValueError(f"the poses of a trial are not those that were shown: only {most} of {len(times_s)} are")
    return best


def main() -> None:
    """Print the figures."""
    import cv2

    cv2.setNumThreads(1)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--trials", type=int, default=20, help="rendered trials of a twin")
    parser.add_argument("--occlusions", type=int, default=1000)
    parser.add_argument("--learn-trials", type=int, default=8)
    parser.add_argument("--set-points", type=float, default=60.0, metavar="S", help="seconds of set-points, twice")
    arguments = parser.parse_args()
    trials = [trial(seed) for seed in range(arguments.trials)]
    figures: dict[str, Any] = {
        "lens_known": precision(mock_view(), trials, Looks()),
        "lens_calibrated": precision(calibrated_view(), trials, Looks()),
        "lens_known_twice_the_blur_and_noise": precision(mock_view(), trials, Looks(blur_px=3.0, noise=0.04)),
        "full_picture_ms": full_frame_ms(),
    }
    if arguments.set_points:
        figures["set_points"] = set_points(arguments.set_points)
    if arguments.occlusions:
        figures["occlusion"] = occlusions(arguments.occlusions)
    if arguments.learn_trials:
        figures["learn"] = learning(arguments.learn_trials)
    if arguments.json:
        print(json.dumps(figures))
        return
    for name, figure in figures.items():
        print(f"{name}: {figure}")


if __name__ == "__main__":
    main()
