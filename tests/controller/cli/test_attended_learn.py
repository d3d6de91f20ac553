"""`learn` with a person at a terminal: a pseudo-terminal of 60 columns, a mock in real time."""

import fcntl
import json
import os
import pty
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.records import LoggedTrial, Verdict
from vvvaltr.controller.core.values import Outcome
from vvvaltr.controller.robot.hardware import open_motors
from vvvaltr.controller.robot.robot_file import load_robot_file
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.process import MockProcess

PROGRAM = "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())"
START = "\n[start]\nx_m = 0.02\ny_m = 0.0\nwithin_m = 0.01\n[arena]\nx_m = [-0.3, 0.3]\ny_m = [-0.3, 0.3]\n"


class Person:
    """At a terminal of 60 columns, which is the program's own."""

    def __init__(self, *arguments: str, **environment: str) -> None:
        self.said = ""
        self._process, self._terminal = pty.fork()
        if not self._process:
            os.environ.update({"TERM": "xterm", "COLUMNS": "60", "LINES": "24", **environment})
            os.execv(sys.executable, [sys.executable, "-c", PROGRAM, *arguments])
        fcntl.ioctl(self._terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 60, 0, 0))

    def press(self, keys: str) -> None:
        os.write(self._terminal, keys.encode())

    def wait_for(self, words: str, timeout_s: float = 60.0) -> None:
        """Wait until the program says ``words``, which it has not said before."""
        until_s, seen = time.monotonic() + timeout_s, ""
        while words not in seen:
            assert time.monotonic() < until_s, self.said
            if select.select([self._terminal], [], [], 0.1)[0]:
                came = os.read(self._terminal, 4096).decode(errors="replace")
                self.said, seen = self.said + came, seen + came

    def leave(self) -> None:
        """Close the terminal."""
        os.close(self._terminal)

    def end(self, timeout_s: float = 30.0) -> int:
        """Return the exit status."""
        until_s = time.monotonic() + timeout_s
        while True:
            with suppress(OSError):
                if select.select([self._terminal], [], [], 0.05)[0]:
                    self.said += os.read(self._terminal, 4096).decode(errors="replace")
            process, status = os.waitpid(self._process, os.WNOHANG)
            if process:
                return os.waitstatus_to_exitcode(status)
            assert time.monotonic() < until_s, self.said


@pytest.fixture
def mock(tmp_path: Path) -> Iterator[MockProcess]:
    with MockProcess("node", tmp_path / "port") as running:
        yield running


def robot_file(mock: MockProcess, more: str = "") -> str:
    path = Path(mock.greeting.robot_file)
    own = path.with_name("own.toml")
    own.write_text(path.read_text() + more)
    return str(own)


def trials(run: Path) -> tuple[LoggedTrial, ...]:
    return read_run(run).trials


def test_a_run_at_a_terminal_waits_for_its_person_and_takes_every_wish(mock: MockProcess, tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = ["--no-hand", "--trials", "9", "--duration", "3", "--no-recording", "--out", str(out)]
    person = Person("learn", "--robot", robot_file(mock, START), *options)

    person.wait_for("move 0.02 m (x +0.02 y")  # nobody moves it, so a key begins the trial
    person.press("g")
    person.wait_for("d discard")
    person.press("d")
    person.wait_for("why")
    person.press("cable\n")
    person.wait_for("trial 2: move")
    person.press("t")
    person.wait_for("note")
    person.press("windy\n")
    person.wait_for("trial 2: move")
    person.press("g")
    person.wait_for("trial 2 drives")
    person.press(" ")  # in the 3 s of the drive, also on a busy computer
    person.wait_for("trial 3: stopped")
    person.press("e")
    status = person.end()

    first, second = trials(out)
    assert status == 0, person.said
    assert (first.review.verdict, first.review.verdict_reason, first.score) == (Verdict.DISCARD, "cable", None)
    assert (second.trial.outcome, second.review.notes) == (Outcome.INTERRUPTED, "windy")
    assert mock.wait_until(lambda it: it.is_at_rest)


def test_a_long_pause_lets_go_of_the_line_and_takes_it_up_again(mock: MockProcess, tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = ["--no-hand", "--park-after", "0.3", "--trials", "1", "--duration", "0.5", "--no-recording"]
    person = Person("learn", "--robot", robot_file(mock, START), *options, "--out", str(out))
    person.wait_for("trial 1: move")
    person.press("p")
    person.wait_for("trial 1: paused")
    time.sleep(0.6)

    (line,) = load_robot_file(Path(mock.greeting.robot_file)).line
    with closing(open_motors(line)) as another:  # the line is free
        another.state()
    person.press("g")
    person.wait_for("Enter keep")
    person.press("\n")

    assert person.end() == 0, person.said
    assert [logged.trial.outcome for logged in trials(out)] == [Outcome.COMPLETED]


def test_a_run_that_ends_before_its_first_trial_says_so_and_blames_no_method(mock: MockProcess, tmp_path: Path) -> None:
    options = ["--no-hand", "--no-recording", "--out", str(tmp_path / "run")]
    person = Person("learn", "--robot", robot_file(mock, START), *options)
    person.wait_for("trial 1: move")
    person.press("e")

    assert person.end() == 0
    assert "best gait  not known: no trial has measured anything yet" in person.said
    assert "trials     0\r\n" in person.said


def test_a_terminal_that_closes_while_waiting_leaves_the_motors_at_rest_and_the_run_saved(
    mock: MockProcess, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    person = Person("learn", "--robot", robot_file(mock, START), "--no-hand", "--no-recording", "--out", str(out))
    person.wait_for("trial 1: move")

    person.leave()

    assert person.end() == 130
    assert trials(out) == ()
    assert json.loads((out / "summary.json").read_text())["trials"] == 0
    assert mock.wait_until(lambda it: it.is_at_rest)


def test_a_terminal_that_closes_in_a_drive_stops_the_motors_and_says_why_the_run_ended(
    mock: MockProcess, tmp_path: Path
) -> None:
    out, events = tmp_path / "run", tmp_path / "events"
    options = ["--no-hand", "--no-recording", "--duration", "20", "--out", str(out), "--events", str(events)]
    person = Person("learn", "--robot", robot_file(mock), "--reposition", "never", *options)
    person.wait_for("trial 1 drives")
    mock.wait_until(lambda it: not it.is_at_rest)

    person.leave()

    assert mock.wait_until(lambda it: it.is_at_rest)
    assert person.end() == 130
    assert [logged.trial.outcome for logged in trials(out)] == [Outcome.INTERRUPTED]
    end = json.loads(events.read_text().splitlines()[-1])
    assert end == {"event": "end", "text": trials(out)[0].trial.reason}
    assert end["text"] in ("SIGHUP", "the terminal was closed")


def test_the_hand_of_a_mock_puts_it_back_without_anybody(mock: MockProcess, tmp_path: Path) -> None:
    out, events = tmp_path / "run", tmp_path / "events"
    options = ["--trials", "2", "--duration", "0.5", "--no-recording", "--events", str(events), "--out", str(out)]

    assert main(["learn", "--robot", robot_file(mock, START), *options]) == 0

    starts = [logged.trial.start for logged in trials(out)]
    assert all(start is not None and abs(start.position_m[0] - 0.02) < 0.011 for start in starts)
    assert "waiting" in {json.loads(line)["event"] for line in events.read_text().splitlines()}


def test_without_hand_and_terminal_the_run_ends_with_that_reason(
    mock: MockProcess, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = main(["learn", "--robot", robot_file(mock, START), "--no-hand", "--out", str(tmp_path / "run")])

    assert status == 1
    assert (
        "nobody is there to put it back: run it --attended, or choose --reposition arena or never"
        in capsys.readouterr().err
    )


def test_attended_without_a_terminal_is_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-c", PROGRAM, "learn", "--attended", "--out", str(tmp_path / "run")]

    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)

    assert ended.returncode == 1
    assert ended.stderr == (
        "vvvaltr: --attended needs a terminal, and there is none here: over ssh, ask for one by ssh -t\n"
    )
    assert not (tmp_path / "run").exists()


def test_a_twin_is_put_back_by_its_scatter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["learn", "--reposition", "never", "--out", str(tmp_path / "run")]) == 2

    assert "a twin is put back, or left, as its --scatter says" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
