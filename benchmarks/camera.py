"""How well and how fast the overhead camera sees a twin's run, and that it never sees what is not there.

Pictures are rendered: 1280 x 720, 65 degrees wide, from 1 m above the floor and askew by 3 degrees, of a tag of 40 mm
at 60 mm height, with the lens' distortion, blur of 1.5 px, noise of 2 %, uneven light, and the motion blur of 4 ms.
Times are processor times, because the processor is shared.

python -m benchmarks.camera --json
"""

from __future__ import annotations

import json
import math
import random
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.camera_hidden import occlusions, set_points
from benchmarks.camera_learning import learning
from benchmarks.figures import make_parser
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.trackers.camera.feed import FLOOR_M, LENS, TAG, mock_view
from vvvaltr.drivers.trackers.camera.pictures import Looks, Painter, board_picture
from vvvaltr.drivers.trackers.camera.sight import Sight, Unseen
from vvvaltr.drivers.trackers.camera.view import View

if TYPE_CHECKING:
    from vvvaltr.drivers.trackers.camera.lens import Lens

PERIOD_S = 1.0 / 30.0
TRIAL_S = 5.0
WITHIN_M = (0.42, 0.22)  # of the picture's middle


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


def main() -> None:
    """Print the figures."""
    import cv2

    cv2.setNumThreads(1)
    parser = make_parser(__doc__)
    parser.add_argument("--trials", type=int, default=20, help="number of rendered trials of a twin")
    parser.add_argument("--occlusions", type=int, default=1000, help="how often the robot is hidden")
    parser.add_argument("--learn-trials", type=int, default=8, help="number of trials of a run that sees by the camera")
    parser.add_argument(
        "--set-points",
        type=float,
        default=60.0,
        metavar="S",
        help="time of set-points in s, without a camera and again with one",
    )
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
