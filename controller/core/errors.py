"""The errors that users and callers meet. Device errors are also the built-in errors that they are."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from vvvaltr.controller.core.values import Outcome


class DeviceError(Exception):
    """A device did not do what it should. The kinds below say how."""


class DeviceTimeout(DeviceError, TimeoutError):
    """A device did not answer in time."""


class DeviceFault(DeviceError):
    """A device reports a fault of its own; ``code`` is the device's name or number for it."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


class LinkLost(DeviceError, ConnectionError):
    """The line to a device is gone: unplugged, off the bus, rebooted."""


class TrackingLost(Exception):
    """The tracker has no pose that can be trusted. ``cure`` is empty where none is known."""

    def __init__(self, reason: str, cure: str = "") -> None:
        super().__init__(f"{reason}; {cure}" if cure else reason)
        self.reason = reason
        self.cure = cure


class SafetyStop(Exception):
    """A guard ends the trial. An outcome of the trial, not a crash of the program."""

    def __init__(self, outcome: Outcome, reason: str) -> None:
        super().__init__(reason)
        self.outcome = outcome
        self.reason = reason


class NothingToRecommend(ValueError):
    """An optimiser cannot say yet which gait is best."""


class UserError(Exception):
    """What a user can put right: one line that names what was wrong, and the cure."""


class NotUnderstood(UserError):
    """A word of the command line, or of a file named there, that means nothing: an unknown name, key or value."""


@contextmanager
def one_line_errors() -> Iterator[None]:
    """Turn a ValueError of the rooms below, which speaks of what a user gave, into NotUnderstood."""
    try:
        yield
    except UnicodeEncodeError:
        raise  # of a name of the user's that is not UTF-8, not of a value
    except ValueError as error:
        raise NotUnderstood(str(error)) from error
