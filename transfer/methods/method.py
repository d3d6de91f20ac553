"""What a method says of itself: its row in the registry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.protocols import AskTell
from vvvaltr.controller.core.values import Source


@dataclass(frozen=True, slots=True)
class Method:
    """A way to learn, as the registry lists it.

    Args:
        name: name on the command line and in ``run.toml``.
        description: one line for the user.
        uses_sources: whether the method needs at least one source; a method that does not need one accepts none.
        make: makes an optimiser from the space of gaits, the seed and the sources; ``ask`` and ``tell`` suffice. It
            raises ValueError where it cannot use them.
    """

    name: str
    description: str
    uses_sources: bool
    make: Callable[[GaitSpace, int, Sequence[Source]], AskTell]
