"""Commands called in this process, as from the command line."""

import json
from collections.abc import Sequence
from typing import Any

import pytest

from vvvaltr.controller.cli.main import main


def call(arguments: Sequence[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    """Return exit status, standard output and standard error of a command."""
    try:
        status = main(arguments)
    except SystemExit as usage:
        status = int(usage.code or 0)
    out, err = capsys.readouterr()
    return status, out, err


def answer(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, dict[str, Any]]:
    """Return exit status of a command, and the object that it prints last; empty where it prints nothing."""
    capsys.readouterr()
    status = main([*arguments, "--json"])
    last = capsys.readouterr().out.strip().splitlines()
    return status, json.loads(last[-1]) if last else {}
