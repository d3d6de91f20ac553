import logging
from dataclasses import dataclass, field

import pytest
from scripted import ScriptedRobot, raising

from vvvaltr.controller.core.errors import TrackingLost, UserError
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.protocols import Observer
from vvvaltr.controller.core.records import Event, EventKind, LoggedTrial
from vvvaltr.controller.loop.learn import learn
from vvvaltr.controller.loop.plan import Budget
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.transfer.methods.random_search import RandomSearch


@dataclass
class Notebook:
    """Notes all it is told; from trial ``breaks_at`` on it fails."""

    breaks_at: int = 99
    trials: list[int] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def on_trial(self, logged: LoggedTrial) -> None:
        if logged.trial.number >= self.breaks_at:
            raise OSError("no space left")
        self.trials.append(logged.trial.number)

    def on_event(self, event: Event) -> None:
        self.events.append(event)


def follow(*observers: Observer, robot: ScriptedRobot | None = None, trials: int = 3) -> list[LoggedTrial]:
    log: list[LoggedTrial] = []
    optimizer = RandomSearch(GaitSpace.over(3, 4.0, 16.7), 1)
    settings = TrialSettings(duration_s=0.5)
    for _ in learn(robot or ScriptedRobot(), optimizer, settings, Budget(trials), log.append, (), observers):
        pass
    return log


def test_observers_are_told_of_each_trial_and_of_begin_and_end() -> None:
    first, second = Notebook(), Notebook()

    follow(first, second)

    assert first.trials == second.trials == [1, 2, 3]
    assert first.events == [
        Event(EventKind.BEGIN, "0 trials made, 3 valid ones wanted"),
        Event(EventKind.END, "complete"),
    ]


def test_a_trial_is_in_the_log_before_an_observer_is_told() -> None:
    log: list[LoggedTrial] = []

    class Reader(Notebook):
        def on_trial(self, logged: LoggedTrial) -> None:
            assert log[-1] is logged
            super().on_trial(logged)

    reader = Reader()
    optimizer = RandomSearch(GaitSpace.over(3, 4.0, 16.7), 1)
    list(learn(ScriptedRobot(), optimizer, TrialSettings(duration_s=0.5), Budget(2), log.append, (), [reader]))

    assert reader.trials == [1, 2]


def test_an_observer_that_fails_is_dropped_with_one_warning_and_the_run_goes_on(
    caplog: pytest.LogCaptureFixture,
) -> None:
    broken, sound = Notebook(breaks_at=2), Notebook()

    with caplog.at_level(logging.WARNING):
        log = follow(broken, sound, trials=4)

    problem = "Notebook failed and is told nothing more: OSError: no space left"
    assert len(log) == 4
    assert (broken.trials, sound.trials) == ([1], [1, 2, 3, 4])
    assert [record.message for record in caplog.records] == [problem]
    assert Event(EventKind.WARNING, problem) in sound.events
    assert broken.events[-1].kind is EventKind.BEGIN


def test_a_log_that_fails_ends_the_run() -> None:
    notebook = Notebook()

    def full_disk(logged: LoggedTrial) -> None:
        raise OSError("no space left")

    optimizer = RandomSearch(GaitSpace.over(3, 4.0, 16.7), 1)
    with pytest.raises(OSError, match="no space left"):
        list(learn(ScriptedRobot(), optimizer, TrialSettings(duration_s=0.5), Budget(2), full_disk, (), [notebook]))

    assert notebook.trials == []
    assert notebook.events[-1] == Event(EventKind.END, "no space left")


def test_failed_trials_are_warned_of_and_the_end_says_why() -> None:
    notebook = Notebook()

    with pytest.raises(UserError):
        follow(notebook, robot=ScriptedRobot(at_s=0.0, event=raising(TrackingLost("hidden"))))

    assert notebook.trials == [1, 2, 3]
    assert notebook.events[1] == Event(EventKind.WARNING, "trial 1 measured nothing: tracking lost: hidden")
    assert notebook.events[-1].text.startswith("3 trials in a row failed")


def test_an_interrupted_trial_is_shown_and_named_at_the_end() -> None:
    notebook = Notebook()

    with pytest.raises(KeyboardInterrupt):
        follow(notebook, robot=ScriptedRobot(at_s=0.2, event=raising(KeyboardInterrupt("SIGTERM"))))

    assert notebook.trials == [1]
    assert notebook.events[-1] == Event(EventKind.END, "SIGTERM")
