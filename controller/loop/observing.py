"""Tells those who follow a run of its trials and events. None of them can end it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from vvvaltr.controller.core.protocols import Observer
from vvvaltr.controller.core.records import Event, EventKind, LoggedTrial

_LOGGER = logging.getLogger(__name__)


class Followers:
    """The observers of one run. One that raises is named in a warning once, and is told nothing more."""

    def __init__(self, observers: Sequence[Observer]) -> None:
        self._observers = list(observers)

    def announce(self, kind: EventKind, text: str) -> None:
        """Tell all of an event."""
        self._tell_all(lambda observer: observer.on_event(Event(kind, text)))

    def show(self, logged: LoggedTrial) -> None:
        """Tell all of a trial, and warn of one that failed."""
        self._tell_all(lambda observer: observer.on_trial(logged))
        trial = logged.trial
        if not trial.outcome.is_valid:
            self.announce(EventKind.WARNING, f"trial {trial.number} measured nothing: {trial.ending}")

    def _tell_all(self, tell: Callable[[Observer], None]) -> None:
        dropped = [problem for observer in tuple(self._observers) if (problem := self._drop_on_failure(observer, tell))]
        for problem in dropped:
            _LOGGER.warning(problem)
            self.announce(EventKind.WARNING, problem)

    def _drop_on_failure(self, observer: Observer, tell: Callable[[Observer], None]) -> str:
        """Tell one observer; return what went wrong, in words, or nothing."""
        try:
            tell(observer)
        except Exception as error:  # whatever it is, it must not end the run: the trial is in the log
            self._observers.remove(observer)
            return f"{type(observer).__name__} failed and is told nothing more: {type(error).__name__}: {error}"
        return ""


def describe_end(error: BaseException) -> str:
    """Return why a run ended that was not complete."""
    if isinstance(error, GeneratorExit):
        return "the program that follows the run wanted no more trials"
    return str(error) or type(error).__name__
