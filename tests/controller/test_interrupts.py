"""An interrupt is told as one, whenever it comes."""

import errno
import json
import os

import pytest

from controller import cli
from controller.cli import main
from twin.robot import TwinRobot


def interrupted(*_: object) -> None:
    raise KeyboardInterrupt("SIGINT")


def test_an_interrupted_trial_ends_with_the_status_of_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(TwinRobot, "place", interrupted)

    assert main(["run", "12", "12", "12", "--robot", "planar", "--json"]) == 130
    assert json.loads(capsys.readouterr().out)["outcome"] == "interrupted"


def test_an_interrupt_while_the_commands_are_imported_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cli, "_parser", interrupted)

    assert main(["learn"]) == 130
    assert capsys.readouterr().err == "vvvaltr: interrupted (SIGINT)\n"


def test_a_full_disk_is_told_with_its_cure(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(cli, "_parser", full)

    assert main(["learn"]) == 1
    assert "No space left on device; free some space" in capsys.readouterr().err
