"""How a run goes, on standard error: a bar on a terminal that can write a line anew, else one line a trial."""

from __future__ import annotations

import shutil
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.telling import bar, can_repaint, say, say_above, to_whoever_listens
from vvvaltr.controller.core.records import Verdict
from vvvaltr.controller.core.values import Phase

if TYPE_CHECKING:
    from vvvaltr.controller.core.records import LoggedTrial

_VERDICTS = {Verdict.DISCARD: "discarded", Verdict.SKIP: "skipped"}
_VAGUE = 10.0  # an interval that reaches beyond so many times its mean tells no best gait


class TrialProgress:
    """Tells of each trial of a run: its speed, the best gait so far with its interval, failures, and the time left.

    Args:
        arguments: those of the command, which say how much is told.
        total: number of valid trials wanted.
        done: number of valid trials made before, without those of the reference gait, which come on top.
        clear: removes what else is shown on the bar's line; None where nothing is.
    """

    def __init__(self, arguments: Namespace, total: int, done: int, clear: Callable[[], None] | None = None) -> None:
        self._clear = clear
        self._arguments, self._total, self._begun, self._done = arguments, total, done, done
        self._failures: Counter[str] = Counter()
        self._began_s = time.monotonic()
        width, height = shutil.get_terminal_size()  # given to the bar, which hides itself on a serial console of 0 x 0
        self._bar = bar(
            arguments, total=total, initial=done, desc="learning",
            ncols=width - 1, nrows=height, bar_format="{desc} {n}/{total} |{bar}| {remaining} left{postfix}",
        )  # fmt: skip

    def tell(self, logged: LoggedTrial) -> None:
        """Tell of one more trial."""
        if self._clear:
            self._clear()
        if logged.review.verdict in (Verdict.DISCARD, Verdict.SKIP):
            why = f": {logged.review.verdict_reason}" if logged.review.verdict_reason else ""
            self.warn(f"trial {logged.trial.number}: {_VERDICTS[logged.review.verdict]}{why}")
            return
        if logged.score is None:
            self._failures[logged.trial.outcome.words] += 1
            self.warn(f"trial {logged.trial.number}: {logged.trial.ending}")
            return
        if logged.review.is_suspect:
            self.warn(f"trial {logged.trial.number} is suspect: {logged.review.suspicion}")
        if logged.trial.reason:
            self.warn(f"trial {logged.trial.number} was cut short: {logged.trial.reason}")
        counts = logged.suggestion.phase is not Phase.REFERENCE
        self._done += counts
        self._bar.set_postfix_str(f"{_write_speeds(logged)}{self._write_failures()}", refresh=False)
        with to_whoever_listens():
            self._bar.update(int(counts))
        if not can_repaint():
            left = f"; {_write_duration(self._estimate_left_s())} left" if self._done < self._total else ""
            place = f"{self._done} of {self._total}" if counts else "reference"
            say(self._arguments, f"trial {logged.trial.number}, {place}: "
                f"{_write_speeds(logged)}{self._write_failures()}{left}")  # fmt: skip

    def warn(self, line: str) -> None:
        """Tell a line above the bar."""
        if self._clear:
            self._clear()
        say_above(self._bar, line)

    def close(self) -> None:
        """Leave the bar as it is."""
        with to_whoever_listens():
            self._bar.close()

    def _estimate_left_s(self) -> float:
        each_s = (time.monotonic() - self._began_s) / max(1, self._done - self._begun)
        return each_s * (self._total - self._done)

    def _write_failures(self) -> str:
        return "".join(f", {count} {name}" for name, count in self._failures.items())


def _write_duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"


def is_vague(mean: float, low: float, high: float) -> bool:
    """Return whether an estimate says next to nothing, as after the first trials."""
    return max(-low, high) > _VAGUE * abs(mean)


def _write_speeds(logged: LoggedTrial) -> str:
    speed = "" if logged.score is None else f"{1000.0 * logged.score:.1f} mm/s"
    if logged.recommendation is None:
        return speed
    it = logged.recommendation.estimate
    if is_vague(it.mean, it.low, it.high):
        return f"{speed}, best not known yet"
    return f"{speed}, best {1000.0 * it.mean:.1f} ({round(1000.0 * it.low)} to {round(1000.0 * it.high)})"
