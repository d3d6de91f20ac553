"""Work over processes of this computer, which end with the one that began them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

_OF_THE_TERMINAL = (signal.SIGINT, signal.SIGQUIT)


@contextmanager
def processes(jobs: int) -> Iterator[Executor]:
    """Yield ``jobs`` processes of this computer; what they are doing when the block is left is given up."""
    # Not forked: a fork would copy locks and threads of this process as they are.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), initializer=_prepare) as executor:
        try:
            _start(executor)
            yield executor
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def _start(executor: Executor) -> None:
    """Start all processes with signals blocked, which they inherit: Ctrl-C must not end one that is still importing."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _OF_THE_TERMINAL)
    try:
        executor.submit(int)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare() -> None:
    # Ctrl-C reaches all processes of a terminal; the first one decides what becomes of the others.
    for number in _OF_THE_TERMINAL:
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
