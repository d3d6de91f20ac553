"""The `vvvaltr` command: from its first statement to the end of its process, a signal ends it in one line, status 130.

The handlers are in place before anything else is imported, which takes a good part of a second. While nothing has been
opened and after everything has been closed, a signal ends the process at once; in between it raises KeyboardInterrupt,
see ``vvvaltr.controller.core.signals``.
"""

import _signal  # type: ignore[import-not-found]  # built in; importing signal takes a millisecond without handlers
import io
import os
import sys

_NAMES = {getattr(_signal, name): name for name in ("SIGINT", "SIGQUIT", "SIGTERM", "SIGHUP")} | {_signal.SIGALRM: ""}
_INTERRUPTED = 130


def _end_at_once(number: int, frame: object) -> None:
    name = _NAMES[number]
    _say(f"vvvaltr: interrupted ({name})" if name else "vvvaltr: interrupted")
    os._exit(_INTERRUPTED)


def _end_at_once_on_signals() -> None:
    for number in _NAMES:
        # Who ignores the end of the session, as nohup does, wants the program to go on.
        if number != _signal.SIGHUP or _signal.getsignal(number) != _signal.SIG_IGN:
            _signal.signal(number, _end_at_once)
    if callable(_signal.getsignal(_signal.SIGTSTP)):  # there were motors
        _signal.signal(_signal.SIGTSTP, _signal.SIG_DFL)


def _say(line: str) -> None:
    try:
        os.write(2, f"{line}\n".encode())
    except OSError:
        return


if "multiprocessing.spawn" not in sys.modules:  # a process of ours at work imports this too, and has its own ways
    _end_at_once_on_signals()

from typing import NoReturn  # noqa: E402


def main() -> NoReturn:
    """Run the command line, and end the process with its status."""
    try:
        _open_missing_streams()
        status = _run()
        _end_at_once_on_signals()
    except KeyboardInterrupt as interrupt:  # between two statements that handle it better
        _end_at_once_on_signals()
        _say(f"vvvaltr: interrupted ({interrupt})")
        status = _INTERRUPTED
    _leave(status)


def _run() -> int:
    from vvvaltr.controller.cli.main import main as run

    try:
        return run()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)


def _open_missing_streams() -> None:
    """Let what nobody listens to go nowhere: otherwise it would go into the next file that is opened."""
    for number, mode in enumerate(("r", "w", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
            name = ("stdin", "stdout", "stderr")[number]
            setattr(sys, name, open(number, mode, encoding="utf-8", errors="replace", closefd=False))  # noqa: SIM115
    # A letter that the terminal does not have must not end a run, nor must progress that nobody can be told of.
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    told = io.BufferedWriter(_Progress(2, "w", closefd=False))
    sys.stderr = io.TextIOWrapper(told, sys.stderr.encoding, "backslashreplace", line_buffering=True)


class _Progress(io.FileIO):
    """Standard error: a full disk, a reader that has ended or a terminal that is gone is not the run's concern."""

    def write(self, data: "io._WriteBuffer") -> int:  # type: ignore[name-defined]
        try:
            return super().write(data)
        except OSError:
            return len(data)


def _leave(status: int) -> NoReturn:
    """End the process without the interpreter's own end, during which a signal would end it without a word."""
    import atexit
    import threading

    for thread in threading.enumerate():
        if thread is not threading.main_thread() and not thread.daemon:
            thread.join()
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):  # nobody reads it any more
            continue
    os._exit(status)


if __name__ == "__main__":
    main()
