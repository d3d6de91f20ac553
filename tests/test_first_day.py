"""docs/first-day.md, command by command: each is understood, and for each device all of them are run on its mock.

What takes long is asked for in short: fewer points of one motor, shorter trials. The tracker's poses may be older, as
on a busy computer. Nothing else is changed.
"""

import re
import shlex
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from board_views import write_board_views

from vvvaltr.controller.cli.main import make_parser
from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.process import MockProcess

TEXT = (Path(__file__).parent.parent / "docs" / "first-day.md").read_text()
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL) for line in block.splitlines()]
SHORTER = {
    "calibrate": ("--points", "2", "--seconds", "0.5"),
    "track": ("--duration", "0.5"),
    "learn": ("--duration", "0.5", "--trials", "300", "--no-recording"),  # too many for a stop to come too late
}


def words_of(command: str) -> list[str]:
    program, *words = shlex.split(command)
    assert program == "vvvaltr"
    return words


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    assert make_parser().parse_args(words_of(command)).execute


class Day:
    """The page's commands in a folder of their own, each in a process of its own as a person types it."""

    def __init__(self, folder: Path, device: str, mock: MockProcess) -> None:
        self.folder, self.device, self.mock = folder, device, mock
        self.robot = folder / "robot.toml"

    def commands(self) -> Iterator[list[str]]:
        """Yield the commands in the page's order: of those that write a robot's file the one for this device."""
        for command in COMMANDS:
            if "--driver" not in command or f"--driver {self.device}" in command:
                yield words_of(command)

    def type(self, words: Sequence[str], *more: str) -> str:
        """Return what a command tells, which must do what it is asked for: on a busy computer it may measure again."""
        command = [sys.executable, "-m", "vvvaltr", *words, *more]
        for _ in range(3 if words[0] in ("check", "calibrate", "track") else 1):
            done = subprocess.run(command, cwd=self.folder, stdin=subprocess.DEVNULL, capture_output=True, text=True)
            if done.returncode == 0:
                break
        assert done.returncode == 0, f"{self.device}: {' '.join(words)}: {done.stdout}{done.stderr}"
        return done.stdout

    def init(self, words: list[str]) -> None:
        """Write the robot's file for the mock's port, with the mock's tracker and hand in place of the page's."""
        port = words.index("--port") + 1
        mocked = tomllib.loads(Path(self.mock.greeting.robot_file).read_text())
        (line,) = mocked["line"]
        at = line.get("channel") or line.get("adapter") or line["port"]
        assert "no answer" not in self.type([*words[:port], at, *words[port + 1 :]])
        self.change(tracker={**mocked["tracker"], "age_limit_s": 2.0}, hand=mocked["hand"])

    def learn_until_evening(self, words: Sequence[str]) -> None:
        """Learn, and stop it from another terminal when a trial has measured, as the page says."""
        command = [sys.executable, "-m", "vvvaltr", *words, *SHORTER["learn"]]
        events = self.folder / f"events{len(words)}"
        with subprocess.Popen([*command, "--events", str(events)], cwd=self.folder, stdin=subprocess.DEVNULL) as run:
            while run.poll() is None and not (events.exists() and '"completed"' in events.read_text()):
                time.sleep(0.02)
            self.type(["stop", words[-1]])
        assert run.returncode == 130

    def calibrate_a_motor(self, words: Sequence[str]) -> None:
        """Calibrate the robot's first motor; the others keep their curves."""
        (line,) = tomllib.loads(self.robot.read_text())["line"]
        first, *others = line["motor"]
        self.change(line=[{**line, "motor": [first]}])
        self.type(words, *SHORTER["calibrate"])
        (calibrated,) = tomllib.loads(self.robot.read_text())["line"][0]["motor"]
        assert calibrated["curve"] != first["curve"]
        self.change(line=[{**line, "motor": [calibrated, *others]}])

    def change(self, **tables: object) -> None:
        """Put tables into the robot's file in place of its own; all else stays as it is."""
        self.robot.write_text(to_toml({**tomllib.loads(self.robot.read_text()), **tables}))


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("device", ["qik", "odrive", "node", "struts"])
def test_the_page_is_walked_but_for_its_chapter_of_the_camera(device: str, tmp_path: Path) -> None:
    with MockProcess(device, tmp_path / "port") as mock:
        day = Day(tmp_path, device, mock)
        for words in day.commands():
            match words[0]:
                case "init":
                    day.init(words)
                case "camera" | "track":
                    pass
                case "calibrate" if device != "qik":
                    pass  # motors with a sensor skip this step, says the page
                case "report" if device != "qik":
                    pass  # a page of figures knows no devices
                case "calibrate":
                    day.calibrate_a_motor(words)
                case "learn":
                    day.learn_until_evening(words)
                case _:
                    day.type(words, *SHORTER.get(words[0], ()))
    trials = read_run(tmp_path / "runs/first").trials
    valid = [logged for logged in trials if logged.trial.outcome.is_valid]
    assert len(valid) >= 2  # one a day
    assert valid[-1].recommendation is not None
    assert (tmp_path / "runs/first/report.html").exists() == (device == "qik")


@pytest.mark.flaky(reruns=2)  # in real time
def test_its_chapter_of_the_camera_is_walked(tmp_path: Path) -> None:
    write_board_views(tmp_path / "views", 12)
    with MockProcess("node", tmp_path / "port", "--tracker", "camera") as mock:
        day = Day(tmp_path, "node", mock)
        told = {}
        for words in day.commands():
            match words[0]:
                case "init":
                    day.init(words)
                    camera = tomllib.loads(day.robot.read_text())["tracker"]
                case "camera" if "calibrate" in words:
                    day.change(tracker={**camera, "source": "views"})
                    day.type(words, "--views", "7")
                    lens = tomllib.loads(day.robot.read_text())["tracker"]["lens"]
                    day.change(tracker={**camera, "lens": lens})
                case "camera" | "track":
                    told[words[-1]] = day.type(words, *SHORTER.get(words[0], ()))

    assert lens["focal_px"] == pytest.approx(camera["lens"]["focal_px"], rel=0.01)
    assert {path.name for path in tmp_path.glob("*.png")} == {"tag-1.png", "tag-2.png", "board.png", "camera.png"}
    assert float(told["robot.toml"].split()[1]) == pytest.approx(0.0, abs=0.002)  # x, in m
