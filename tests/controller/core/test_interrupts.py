"""An interrupt is told as one, whenever it comes."""

import errno
import json
import os
import signal
import subprocess
import sys

import pytest

from vvvaltr.controller.cli import main as cli
from vvvaltr.controller.cli.main import main
from vvvaltr.twin.robot import TwinRobot


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt("SIGINT")


def test_an_interrupted_trial_ends_with_the_status_of_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(TwinRobot, "place", interrupted)

    assert main(["trial", "12", "12", "12", "--robot", "planar", "--json"]) == 130
    assert json.loads(capsys.readouterr().out)["outcome"] == "interrupted"


def test_an_interrupt_while_the_commands_are_imported_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "make_parser", interrupted)

    assert main(["learn"]) == 130
    assert capsys.readouterr().err == "vvvaltr: interrupted (SIGINT)\n"


def test_a_full_disk_is_told_with_its_cure(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(cli, "make_parser", full)

    assert main(["learn"]) == 1
    assert "No space left on device; free some space" in capsys.readouterr().err


def test_an_interrupt_that_comes_in_a_finalizer_is_not_lost() -> None:
    # Python drops what a finalizer raises; so does cffi, whose finalizers free a twin's physics at every trial.
    script = """
import signal, time
from vvvaltr.controller.core.signals import interrupt_on_signals

class Dying:
    def __del__(self):
        signal.raise_signal(signal.SIGTERM)
        time.sleep(0.1)

interrupt_on_signals()
try:
    Dying()
    time.sleep(20)
except KeyboardInterrupt as interrupt:
    print(interrupt)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=10, check=True)

    assert (done.stdout, done.stderr) == ("SIGTERM\n", "")


@pytest.mark.parametrize(("motors", "told"), [("interrupt_on_suspension()", "SIGTSTP\n"), ("", "went on\n")])
def test_a_suspension_is_an_interrupt_where_there_are_motors(motors: str, told: str) -> None:
    script = f"""
import os, signal
from vvvaltr.controller.core.signals import interrupt_on_signals, interrupt_on_suspension

interrupt_on_signals()
{motors}
try:
    os.kill(os.getpid(), signal.SIGTSTP)
    print("went on")
except KeyboardInterrupt as interrupt:
    print(interrupt)
"""
    with subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, process_group=0
    ) as program:
        _, status = os.waitpid(program.pid, os.WUNTRACED)
        if was_suspended := os.WIFSTOPPED(status):
            os.killpg(program.pid, signal.SIGCONT)
        assert program.stdout is not None
        assert program.stdout.read() == told
    assert was_suspended is not bool(motors)


def test_other_errors_of_finalizers_are_still_shown() -> None:
    script = """
from vvvaltr.controller.core.signals import interrupt_on_signals

class Dying:
    def __del__(self):
        raise ValueError("spilled")

interrupt_on_signals()
Dying()
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=10, check=True)

    assert "ValueError: spilled" in done.stderr
