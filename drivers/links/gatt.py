"""Radio links to several Bluetooth LE devices, opened together: a short text to each, short texts from each.

A device is called a strut here, for that is what it is. ``bluetooth.py`` has the links over the computer's own radio,
``air.py`` those to a mock.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from vvvaltr.controller.core.errors import DeviceFault, DeviceTimeout
from vvvaltr.controller.core.printable import printable

_ADDRESS = re.compile(r"([0-9A-F]{2}:){5}[0-9A-F]{2}", re.IGNORECASE)
_MOST_NAMES = 8


@dataclass(frozen=True, slots=True)
class Wanted:
    """A strut to be found.

    Args:
        strut: its name or address.
        characteristic: UUID of the characteristic for both directions; empty for the only one that serves.
    """

    strut: str
    characteristic: str = ""


@dataclass(frozen=True, slots=True)
class Word:
    """What came from a strut.

    Args:
        strut: number of the strut, counted from 0.
        heard_s: when it came, as ``time.monotonic()`` counts.
        text: the notification, or the text that the strut acknowledges.
        acknowledges: whether it is the latter.
    """

    strut: int
    heard_s: float
    text: bytes
    acknowledges: bool = False


class GattLink(Protocol):
    """The radio links to all struts of a line. Reading and writing may happen in two threads at once."""

    @property
    def name(self) -> str:
        """Name of the links in messages: their adapter."""
        ...

    def write(self, strut: int, text: bytes, is_acknowledged: bool) -> None:
        """Send a text, without waiting, and let the strut acknowledge it or not.

        It takes the place of an earlier one that has not been sent yet, so that a stop waits for one text at most.
        Raises LinkLost if the strut's link is lost.
        """
        ...

    def read(self, timeout_s: float) -> Word | None:
        """Return what came next, after waiting at most ``timeout_s`` for it; None if nothing came.

        Raises:
            LinkLost: the link of a strut is lost, which the message names.
        """
        ...

    def close(self) -> None:
        """Send what has not been sent yet, then release the links. Idempotent. Never raises."""
        ...


def in_words(names: Sequence[str]) -> str:
    """Return names as a list in a sentence: ``A, B and C``."""
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else "".join(names)


def is_address(strut: str) -> bool:
    """Return whether a strut is given by its address."""
    return _ADDRESS.fullmatch(strut) is not None


def find_addresses(wanted: Sequence[Wanted], seen: Mapping[str, str]) -> tuple[str, ...]:
    """Return the address of each strut.

    Args:
        wanted: the struts.
        seen: name of each address in the air.

    Raises:
        DeviceTimeout: a strut is not in the air.
        DeviceFault: two have the name of one.
    """
    found = [_matches(strut.strut, seen) for strut in wanted]
    if missing := [strut.strut for strut, addresses in zip(wanted, found, strict=True) if not addresses]:
        plural = "struts" if len(missing) > 1 else "strut"
        raise DeviceTimeout(
            f"{plural} {in_words(missing)} not found in the air{_describe(seen)}; charge the battery, "
            "switch it on, bring it nearer, and end other programs that use it"
        )
    for strut, addresses in zip(wanted, found, strict=True):
        if len(addresses) > 1:
            raise DeviceFault(
                "name",
                f"two struts have the name {strut.strut} ({' and '.join(sorted(addresses))}); put the address of the "
                "right one in the robot's file, as its strut",
            )
    return tuple(addresses[0] for addresses in found)


def are_all_found(wanted: Sequence[Wanted], seen: Mapping[str, str]) -> bool:
    """Return whether every strut has been seen."""
    return all(_matches(strut.strut, seen) for strut in wanted)


def _matches(strut: str, seen: Mapping[str, str]) -> list[str]:
    if is_address(strut):
        return [address for address in seen if address.upper() == strut.upper()]
    return [address for address, name in seen.items() if name == strut]


def _describe(seen: Mapping[str, str]) -> str:
    names = sorted({printable(name)[:40] for name in seen.values() if name})
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return f" (there are {', '.join(names[:_MOST_NAMES])}{more})" if names else " (nothing with a name is)"
