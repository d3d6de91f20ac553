"""What a tracker is worth, as `vvvaltr track` and `vvvaltr check` tell it."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.robot.commissioning.track import Look, problems, sight
from vvvaltr.drivers.links.remote_clock import RemoteClock
from vvvaltr.drivers.mocking.faults import Fault, Kind
from vvvaltr.drivers.mocking.process import MockProcess


class NoClock:
    """A tracker that knows nothing of its clock."""


def looks(rate_hz: float = 100.0, duration_s: float = 2.0, late_s: float = 0.01) -> list[Look]:
    """A thousand looks a second at a robot that lies still, its heading half a turn, in poses that scatter by 1 mm."""
    seen = []
    for step in range(round(1000 * duration_s)):
        number = math.floor((0.001 * step - late_s) * rate_hz)
        sign = 1.0 if number % 2 else -1.0
        yaw_rad = math.remainder(math.pi + 0.01 * sign, math.tau)
        seen.append(Look(0.001 * step, Pose(number / rate_hz, (0.1 + 0.001 * sign, 0.2, 0.03), yaw_rad)))
    return seen


def told(changed: list[Look]) -> str:
    """The problems in one text."""
    return " | ".join(f"{problem.what}: {problem.cure}" for problem in problems(sight(changed, NoClock())))


def test_a_good_tracker_is_measured_and_has_no_problem() -> None:
    seen = sight(looks(), NoClock())

    assert seen.rate_hz == pytest.approx(100.0)
    assert seen.longest_gap_s == pytest.approx(0.01)
    assert seen.noise_m == pytest.approx(0.001, rel=0.01)
    assert seen.noise_rad == pytest.approx(0.01, rel=0.01)
    assert abs(seen.yaw_rad) == pytest.approx(math.pi, abs=0.02)
    assert seen.jitter_s < 0.002
    assert seen.lost_share == 0.0
    assert seen.has_heading
    assert math.isnan(seen.offset_s)
    assert problems(seen) == ()


def test_the_time_before_the_first_pose_does_not_count() -> None:
    waiting = [Look(-1.0, None, "no frame yet")] * 500

    assert sight(waiting + looks(), NoClock()) == sight(looks(), NoClock())


def test_a_tracker_that_shows_nothing_is_one_problem_with_its_own_reason() -> None:
    blind = [Look(0.001 * step, None, "the tracker does not see the robot") for step in range(100)]

    (problem,) = problems(sight(blind, NoClock()))

    assert problem.what == "the tracker does not see the robot"
    assert "show it the robot" in problem.cure


def test_each_fault_of_a_tracker_is_told_with_its_cure() -> None:
    some_lost = [replace(seen, pose=None, reason="hidden") if 500 < n < 900 else seen for n, seen in enumerate(looks())]
    scattered = [
        replace(seen, pose=replace(seen.pose, position_m=(10 * seen.pose.position_m[0], 0.0, 0.0))) for seen in looks()
    ]
    without_angles = [replace(seen, pose=replace(seen.pose, yaw_rad=0.0)) for seen in looks()]
    steep = [replace(seen, pose=replace(seen.pose, pitch_rad=1.5)) for seen in looks()]

    assert "no pose for 20 % of the time: hidden" in told(some_lost)
    assert "a gap of 0.4" in told(some_lost) and "Wi-Fi" in told(some_lost)
    assert told(looks(rate_hz=10.0)) == "10 poses/s: let it send 20 poses/s or more"
    assert "scatters by 10.0 mm" in told(scattered)
    assert "no heading" in told(without_angles) and "yaw_rad" in told(without_angles)
    assert "x forward and z up" in told(steep)


def test_what_the_poses_look_like_is_told_with_the_key_to_set() -> None:
    def at(*position_m: float, yaw_rad: float = 1.0) -> str:
        return told(
            [
                replace(
                    seen,
                    pose=replace(
                        seen.pose,
                        position_m=tuple(x + 1e-4 * math.sin(n) for x in position_m),
                        yaw_rad=yaw_rad + 0.01 * math.sin(n) * yaw_rad,
                    ),
                )
                for n, seen in enumerate(looks())
            ]
        )

    assert at(0.1, 0.2, 0.06) == ""
    assert 'set unit = "mm"' in at(100.0, 200.0, 60.0)
    assert 'set unit = "cm"' in at(10.0, 20.0, 6.0)
    assert 'set unit = "cm"' in at(10.0, 20.0, 3.0)
    assert 'set up = "y"' in at(0.1, 0.06, -0.2)
    assert 'set up = "y"' in at(0.1, 0.06, 0.0)
    assert at(0.1, 0.5, 0.0) == ""  # a body whose origin lies on the ground
    assert 'set up = "y"' in at(0.1, 0.06, 0.9)
    assert 'set yaw_unit = "deg"' in at(0.1, 0.2, 0.06, yaw_rad=57.0)


def test_poses_that_are_the_same_to_the_last_digit_are_a_warning() -> None:
    held = [replace(seen, pose=replace(seen.pose, position_m=(0.1, 0.2, 0.03), yaw_rad=0.5)) for seen in looks()]
    (problem,) = problems(sight(held, NoClock()))
    assert problem.is_warning and "to the last digit" in problem.what


def test_two_bodies_are_told_with_the_cure() -> None:
    both = [
        replace(seen, pose=replace(seen.pose, position_m=(0.5 * (seen.pose.t_s // 0.01 % 2), 0.2, 0.03)))
        for seen in looks()
    ]
    assert "let the tracker see one body alone" in told(both)


@pytest.mark.parametrize("away_m", [0.1, 2.0, 40.0])
def test_poses_that_jump_away_are_told_as_such_and_not_as_noise(away_m: float) -> None:
    def seen_with(every: int) -> list[Look]:
        return [
            replace(seen, pose=replace(seen.pose, position_m=(0.1 + away_m, 0.2, 0.03)))
            if round(100 * seen.pose.t_s) % every == 0
            else seen
            for seen in looks()
        ]

    seldom, often = sight(seen_with(every=100), NoClock()), sight(seen_with(every=7), NoClock())

    assert [problem.is_warning for problem in problems(seldom)] == [True]
    assert [problem.is_warning for problem in problems(often)] == [False]
    assert re.match(r"2[89] of 20\d poses jump away from the others, by up to ", problems(often)[0].what)
    assert "let the tracker see one body alone" in problems(often)[0].cure
    assert often.noise_m == pytest.approx(0.001, rel=0.05)
    assert often.position_m == pytest.approx((0.1, 0.2, 0.03), abs=0.0005)


def test_zeros_among_other_poses_are_a_body_that_is_not_seen() -> None:
    zeros = [
        replace(seen, pose=Pose(seen.pose.t_s, (0.0, 0.0, 0.0))) if round(100 * seen.pose.t_s) % 50 == 0 else seen
        for seen in looks()
    ]
    near_the_origin = [
        replace(seen, pose=replace(seen.pose, position_m=(0.001, 0.002, 0.03))) if any(seen.pose.position_m) else seen
        for seen in zeros
    ]

    assert "poses are zero to the last digit" in told(zeros)
    assert "poses are zero to the last digit" in told(near_the_origin)
    assert "scatters" not in told(zeros) + told(near_the_origin)


def test_a_robot_that_is_carried_does_not_jump_away() -> None:
    carried = [replace(seen, pose=replace(seen.pose, position_m=(seen.pose.t_s, 0.2, 0.03))) for seen in looks(50.0)]

    assert "jump" not in told(carried)


def test_what_the_tracker_remarks_is_a_warning() -> None:
    class Remarking:
        remarks = ("the poses have a key 'yaw', which is not known (did you mean yaw_rad?)",)

    (problem,) = problems(sight(looks(), Remarking()))
    assert problem.is_warning and "yaw_rad" in problem.what


def test_the_cure_of_a_loss_is_the_trackers_own_where_it_knows_one() -> None:
    lost = [Look(0.001 * step, None, "two senders send poses to one port, A and B", "end one") for step in range(100)]
    (problem,) = problems(sight(lost, NoClock()))
    assert problem.cure == "end one"


def test_a_planar_robot_that_only_pitches_has_a_heading() -> None:
    rolling = [replace(seen, pose=replace(seen.pose, yaw_rad=0.0, pitch_rad=0.01)) for seen in looks()]

    assert told(rolling) == ""


def test_clocks_tell_their_offset_and_how_late_messages_come() -> None:
    clock = RemoteClock()
    assert math.isnan(clock.jitter_s) and math.isnan(clock.offset_s)
    for number in range(200):
        late_s = 0.05 if number % 10 == 5 else 0.002
        clock.here_s(0.01 * number, 1000.0 + 0.01 * number + late_s)

    assert clock.offset_s == pytest.approx(-1000.002, abs=1e-3)
    assert clock.jitter_s == pytest.approx(0.048 * math.sqrt(0.1 * 0.9), rel=0.02)  # a tenth of them is 48 ms late


def tracked(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """Return what `track` tells; on a busy computer, which may lose the robot, at the third time at the latest."""
    for _ in range(3):
        capsys.readouterr()
        if main(["track", *arguments, "--json"]) == 0:
            data: dict[str, Any] = json.loads(capsys.readouterr().out)
            return data
    raise AssertionError(capsys.readouterr().err)


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("kind", ["stream", "qtm", "natnet"])
def test_track_tells_of_every_kind_of_tracker(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with MockProcess("qik", tmp_path / "port", "--robot", "spatial", "--tracker", kind) as mock:
        data = tracked(capsys, mock.greeting.robot_file, "--duration", "0.5", "--response")
        assert 0.1 < data["response_s"] < 0.95  # its motors start slowly: the body turns visibly after 0.4 to 0.75 s
        for _ in range(20):  # a busy computer makes gaps: one look without any is enough
            data = tracked(capsys, mock.greeting.robot_file, "--duration", "1")
            if not data["problems"]:
                break

    assert 40.0 < data["rate_hz"] < 55.0
    assert data["noise_m"] < 0.002
    assert abs(data["offset_s"]) < 0.1  # the mock's clock is this computer's
    assert 0.0 <= data["jitter_s"] < 0.03
    assert (data["uncertainty_m"] is None) == (kind == "stream")
    assert data["problems"] == []


def test_a_robot_that_slow_motors_do_not_shake_visibly_is_seen_to_start(
    qik: MockProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    """The planar twin stays within the tracker's noise at three quarters of its speed."""
    assert main(["track", qik.greeting.robot_file, "--duration", "0.5", "--response", "--json"]) == 0
    assert 0.1 < json.loads(capsys.readouterr().out)["response_s"] < 2.0


def test_track_of_a_robot_that_is_not_seen_is_one_line_with_the_cure(
    qik: MockProcess, capsys: pytest.CaptureFixture[str]
) -> None:
    qik.inject(Fault(kind=Kind.BLIND, at_s=0.0, duration_s=1.5))
    assert main(["track", qik.greeting.robot_file, "--duration", "0.5"]) == 1
    assert "show it the robot" in capsys.readouterr().err


def test_track_takes_a_robots_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["track"]) == 2
    assert main(["track", "planar"]) == 2
    assert "vvvaltr track robot.toml" in capsys.readouterr().err
