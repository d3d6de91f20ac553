"""Gaits as arguments of a command: frequencies, or the run that recommends one."""

from __future__ import annotations

import re
from argparse import ArgumentParser
from pathlib import Path
from typing import TYPE_CHECKING

from vvvaltr.controller.core.errors import NotUnderstood, UserError

if TYPE_CHECKING:
    from vvvaltr.controller.core.gaits import Gait

_NUMBERS = re.compile(r"-?[\d.][-\d.,e]*")


def allow_negative_gaits(parser: ArgumentParser) -> None:
    """Let an argument such as ``-12,9,14`` be a gait, which argparse would take for an option."""
    parser._negative_number_matcher = re.compile(r"-[\d.]")


def is_gait(text: str) -> bool:
    """Return whether ``text`` is meant as frequencies, not as the name of a run."""
    return _NUMBERS.fullmatch(text) is not None and not Path(text).exists()


def read_gait(text: str) -> Gait:
    """Return the gait that ``text`` writes as frequencies in Hz, ``12,-14,9``, or the one that a run recommends.

    Raises:
        NotUnderstood: the frequencies are not numbers.
        UserError: there is no such run, or it recommends nothing.
    """
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.runs.log import LOG_NAME, read_run

    if is_gait(text):
        try:
            return Gait(tuple(map(float, text.split(","))))
        except ValueError:
            raise NotUnderstood(f"{text!r} is not a gait: write a frequency for each motor, as in 12,-14,9") from None
    path = Path(text)
    trials = read_run(path / LOG_NAME if path.is_dir() else path).trials
    best = next((it.recommendation for it in reversed(trials) if it.recommendation is not None), None)
    if best is None:
        raise UserError(f"{text} recommends no gait: write its frequencies instead, as in 12,-14,9")
    return best.gait
