"""[tracker] of each kind in a robot's file: one line for what is wrong, before anything is opened."""

from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.drivers.mocking.process import MockProcess

FILE = """
[[line]]
driver = "node"
port = "/dev/null"
[[line.motor]]
max_hz = 16.0
[tracker]
"""


def refusal(tracker: str, tmp_path: Path) -> str:
    path = tmp_path / "robot.toml"
    path.write_text(FILE + tracker, encoding="utf-8")
    with pytest.raises(UserError) as caught:
        load_robot_file(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("tracker", "words"),
    [
        ('kind = "qtm"\nhost = "10.0.0.1"', "body"),
        ('kind = "qtm"\nbody = "robot"', "host"),
        ('kind = "qtm"\nhost = ""\nbody = "robot"', "tracker.host"),
        ('kind = "qtm"\nhost = "10.0.0.1"\nbody = "robot"\nport = 70000', "tracker.port is 70000"),
        ('kind = "qtm"\nhost = "10.0.0.1"\nbody = "robot"\nrate_hz = -1', "tracker.rate_hz is -1"),
        ('kind = "qtm"\nhost = "10.0.0.1"\nbodi = "robot"', "did you mean body?"),
        ('kind = "natnet"\nhost = "10.0.0.1"\nbody = "robot"\nup = "x"', "tracker.up is 'x'"),
        ('kind = "natnet"\nhost = "10.0.0.1"\nbody = "robot"\nage_limit_s = 0', "tracker.age_limit_s is 0"),
        ('kind = "natnet"\nhost = 10\nbody = "robot"', "tracker.host is 10"),
    ],
)
def test_a_mistake_is_told_with_its_key(tracker: str, words: str, tmp_path: Path) -> None:
    assert words in refusal(tracker, tmp_path)


CAMERA = 'kind = "camera"\n[tracker.tag]\nsize_m = 0.04\nheight_m = 0.06\n'
LENS = "[tracker.lens]\nwidth_px = 1280\nheight_px = 720\nfocal_px = [1000, 1000]\n"


def floor(*places_m: tuple[float, float]) -> str:
    return "".join(f"[[tracker.floor]]\nid = {n}\nx_m = {x}\ny_m = {y}\n" for n, (x, y) in enumerate(places_m, 1))


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ("yaw_rad = nan", "tracker.tag.yaw_rad is nan"),
        ("x_m = inf", "tracker.tag.x_m is inf"),
        (floor((0, 0), (1, 0), (1, 1), (0, float("nan"))), "tracker.floor[4].y_m is nan"),
        (floor((0, 0), (1, 1), (2, 2), (3, 3)), "floor has its tags in one line"),
        (floor((1, 1), (1, 1), (1, 1), (1, 1)), "floor has its tags in one line"),
        (f"{LENS}centre_px = [nan, 360]", "tracker.lens.centre_px[1] is nan"),
        (f"{LENS}centre_px = [640, 360]\ndistortion = [0, 0, 0, 0, 0, 0, 0, 0]", "tracker.lens.distortion"),
    ],
)
def test_a_camera_that_could_not_be_a_camera_is_told_with_its_key(tables: str, words: str, tmp_path: Path) -> None:
    assert words in refusal(CAMERA + tables, tmp_path)


@pytest.mark.parametrize("kind", ["qtm", "natnet"])
def test_a_body_that_is_not_known_ends_learn_before_a_motor_turns(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with MockProcess("qik", tmp_path / "port", "--tracker", kind) as mock:
        path = tmp_path / "robot.toml"
        file = Path(mock.greeting.robot_file).read_text(encoding="utf-8")
        assert 'body = "robot"' in file
        path.write_text(file.replace('body = "robot"', 'body = "rodot"'), encoding="utf-8")
        capsys.readouterr()

        status = main(["learn", "--robot", str(path), "--trials", "1", "--out", str(tmp_path / "run")])

        assert not any(any(status.applied_hz) for status in mock.statuses)
    (line,) = capsys.readouterr().err.splitlines()
    assert status == 1
    assert "tracker.body is 'rodot'" in line and "knows 'wand', 'robot'" in line
