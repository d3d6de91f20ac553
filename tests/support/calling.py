"""Commands called in this process, as from the command line."""

from collections.abc import Sequence

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
