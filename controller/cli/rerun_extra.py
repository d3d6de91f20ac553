"""Rerun is an extra: 700 MB that the robot's own computer need not carry."""

from __future__ import annotations

from importlib.util import find_spec

from vvvaltr.controller.core.errors import UserError


def has_rerun() -> bool:
    """Return whether Rerun is installed, without importing it."""
    return find_spec("rerun") is not None


def require_rerun() -> None:
    """Raise UserError, with the cure, where Rerun is not installed."""
    if not has_rerun():
        raise UserError('showing a run needs Rerun: pip install "vvvaltr[rerun]"')
