"""A long run does not fill the memory: of each trial little is kept, and it is enough to go on."""

import gc
import itertools
import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from sample_run import logged_trial
from scripted import ScriptedRobot

from benchmarks.soak import STATED_BYTES
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.values import Outcome, Suggestion
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.memory import Memory
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.summary import summarise
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.runs.log import RunLog

VALID, FAILED = [logged_trial(number) for number in (1, 2, 3)], logged_trial(4, outcome=Outcome.TRACKING_LOST)


class Counting:
    """Asks for ever other gaits, and keeps nothing."""

    def __init__(self) -> None:
        self._hz = itertools.count(4.0, 0.01)

    def ask(self) -> Suggestion:
        return Suggestion(Gait((next(self._hz), next(self._hz), next(self._hz))), "counted")

    def tell(self, gait: Gait, score: float) -> None:
        pass


def test_a_summary_of_what_is_kept_is_that_of_the_whole_run() -> None:
    kept = Memory()
    for logged in (*VALID, FAILED):
        kept.append(logged)

    assert summarise(kept) == summarise([*VALID, FAILED])


def test_earlier_trials_are_kept_in_brief_and_the_last_valid_one_in_full() -> None:
    first, second, third = VALID
    kept = Memory([first, second])

    kept.append(third)
    kept.append(FAILED)

    assert kept == [first.in_brief(), second.in_brief(), third.without_recordings(), FAILED.without_recordings()]
    assert (kept[0].trial.gait, kept[0].score, kept[0].review) == (first.trial.gait, first.score, first.review)
    assert kept[0].recommendation is kept[0].fit is kept[0].movement is None


def test_a_trial_leaves_no_more_in_memory_than_is_stated(tmp_path: Path) -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as alone:  # where no other test's threads allocate
        assert alone.submit(kept_bytes, tmp_path).result() < STATED_BYTES


def kept_bytes(folder: Path) -> float:
    """Return how much each of 64 trials leaves in memory."""
    settings, sizes = TrialSettings(duration_s=0.2), []
    tracemalloc.start()
    try:
        with RunLog.create(folder / "trials.mcap", None) as log:
            for logged in learn(ScriptedRobot(), Counting(), settings, Budget(72), log.append):
                if logged.trial.number in (8, 72):
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()

    return (sizes[1] - sizes[0]) / 64
