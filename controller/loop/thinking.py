"""Thinking while the motors turn: the loop that drives them asks, goes on, and looks later for the answer."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, Protocol, TypeVar

T = TypeVar("T")


class Thinking(Protocol[T]):
    """Answers one question at a time."""

    def ask(self, question: Callable[[], T]) -> None:
        """Begin to think. What was asked before is forgotten."""
        ...

    def forget(self) -> None:
        """Want no answer to what was asked."""
        ...

    def answer(self) -> T | None:
        """Return the answer once, None as long as there is none. Raises what the question raised."""
        ...

    @property
    def is_busy(self) -> bool:
        """Whether a question has not been answered yet."""
        ...

    def close(self) -> None:
        """Let go of everything; waits for a question that is being thought about."""
        ...


class AtOnce(Generic[T]):
    """Thinks in no time, as on a twin, whose clock stands still meanwhile: the same run gives the same answers."""

    def __init__(self) -> None:
        self._answer: T | None = None

    @property
    def is_busy(self) -> bool:
        """Whether there is an answer to be fetched."""
        return self._answer is not None

    def ask(self, question: Callable[[], T]) -> None:
        """Think."""
        self._answer = question()

    def forget(self) -> None:
        """Want no answer."""
        self._answer = None

    def answer(self) -> T | None:
        """Return the answer once."""
        answer, self._answer = self._answer, None
        return answer

    def close(self) -> None:
        """Nothing is open."""


class Aside(Generic[T]):
    """Thinks in a thread of its own, as real time asks for: set-points are sent meanwhile."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, "thinking")
        self._future: Future[T] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a question is being thought about, or its answer has not been fetched."""
        return self._future is not None

    def ask(self, question: Callable[[], T]) -> None:
        """Begin to think, once what was asked before is done with."""
        self.forget()
        self._future = self._thread.submit(question)

    def forget(self) -> None:
        """Want no answer."""
        if self._future is not None:
            self._future.cancel()
        self._future = None

    def answer(self) -> T | None:
        """Return the answer once it is there."""
        if self._future is None or not self._future.done():
            return None
        future, self._future = self._future, None
        return future.result()

    def close(self) -> None:
        """Wait for the thread."""
        self._thread.shutdown(cancel_futures=True)
