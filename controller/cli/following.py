"""Who follows a run while it goes on: a program that reads its events, and a person at a live view in Rerun."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import ExitStack, closing
from typing import TYPE_CHECKING

from vvvaltr.controller.cli.rerun_extra import require_rerun
from vvvaltr.controller.cli.telling import say
from vvvaltr.controller.core.errors import UserError

if TYPE_CHECKING:
    from argparse import _ArgumentGroup

    from vvvaltr.controller.core.protocols import Observer
    from vvvaltr.controller.view.recording import LiveView


def add_following_arguments(group: ArgumentParser | _ArgumentGroup) -> None:
    """Declare how a run can be followed."""
    group.add_argument("--live", action="store_true", help="show the run in Rerun while it goes on")
    group.add_argument("--events", metavar="FILE", help="append each trial and warning to FILE as one line of JSON; "
                       "a number is an open file descriptor")  # fmt: skip


def open_events(arguments: Namespace, stack: ExitStack) -> list[Observer]:
    """Return the observers that ``--events`` and systemd ask for, if they do; ``stack`` closes them.

    Raises:
        UserError: its file cannot be written, or Rerun is missing for ``--live``.
    """
    from vvvaltr.controller.runs.events import EventStream
    from vvvaltr.controller.runs.service import ServiceNotices

    if arguments.live:
        require_rerun()
    followers: list[Observer] = []
    if (notices := ServiceNotices.from_environment()) is not None:
        followers.append(stack.enter_context(closing(notices)))
    if arguments.events is not None:
        followers.append(stack.enter_context(closing(EventStream.open(arguments.events))))
    return followers


def open_live_view(arguments: Namespace, stack: ExitStack, open_view: Callable[[], LiveView]) -> LiveView | None:
    """Return the view that ``--live`` asks for, in a window where there is a screen; ``stack`` closes it."""
    if not arguments.live:
        return None
    view = stack.enter_context(closing(open_view()))
    try:
        view.open_window()
    except UserError:  # a robot's own computer has no screen; another one can watch through an ssh tunnel
        say(arguments, f"the live view has no screen here; to watch it, type rerun --connect {view.url}")
    return view
