"""The methods by name, each with what a user needs to choose one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.core.values import GaitSpace, Source
from vvvaltr.transfer.methods.efficient_bo import EfficientBO
from vvvaltr.transfer.methods.guarded import Guarded
from vvvaltr.transfer.methods.icm import ICM
from vvvaltr.transfer.methods.optimistic import Optimistic
from vvvaltr.transfer.methods.plain_bo import PlainBO
from vvvaltr.transfer.methods.random_search import RandomSearch
from vvvaltr.transfer.methods.rgpe import RGPE
from vvvaltr.transfer.methods.warm import WarmStart


@dataclass(frozen=True, slots=True)
class Method:
    """A way to learn.

    Args:
        description: one line for the user.
        uses_sources: whether it needs at least one source; a method that does not takes none.
        make: from space, seed and sources to an optimiser.
    """

    description: str
    uses_sources: bool
    make: Callable[[GaitSpace, int, Sequence[Source]], Optimizer]


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "plain": Method(
            "Bayesian optimisation from nothing",
            uses_sources=False,
            make=lambda space, seed, _: PlainBO(space, seed),
        ),
        "efficient": Method(
            "Efficient-BO as published: an earlier run's trials count as noisy trials of this one",
            uses_sources=True,
            make=EfficientBO,
        ),
        "guarded": Method(
            "weighs what the sources are worth trial by trial: fast where they are alike, safe where not",
            uses_sources=True,
            make=Guarded,
        ),
        "warm": Method(
            "Plain-BO that begins with the sources' best gaits",
            uses_sources=True,
            make=WarmStart,
        ),
        "rgpe": Method(
            "ensemble of all tasks' processes, weighted by how they rank this task's trials (Feurer et al. 2018)",
            uses_sources=True,
            make=RGPE,
        ),
        "icm": Method(
            "one process of all tasks, with a learned correlation of each source (multi-task Gaussian process)",
            uses_sources=True,
            make=ICM,
        ),
        "optimistic": Method(
            "a control: Plain-BO that takes what is unknown for fast, without a source",
            uses_sources=False,
            make=lambda space, seed, _: Optimistic(space, seed),
        ),
        "random": Method(
            "a control: gaits drawn at random",
            uses_sources=False,
            make=lambda space, seed, _: RandomSearch(space, seed),
        ),
    }
)


def make_optimizer(method: str, space: GaitSpace, seed: int, sources: Sequence[Source] = ()) -> Optimizer:
    """Return an optimiser that has been told nothing yet.

    Raises:
        ValueError: there is no such method, it needs a source or takes none, or a source has another number of motors.
    """
    if method not in METHODS:
        raise ValueError(unknown("method", method, METHODS))
    if METHODS[method].uses_sources and not sources:
        raise ValueError(f"method {method!r} learns from an earlier run: give it a source")
    if sources and not METHODS[method].uses_sources:
        able = ", ".join(name for name, entry in METHODS.items() if entry.uses_sources)
        raise ValueError(f"method {method!r} takes no source: leave the source out, or choose one of {able}")
    for source in sources:
        motors = source.gaits[0].motor_count
        if any(gait.motor_count != space.motor_count for gait in source.gaits):
            raise ValueError(f"source {source.name} is of {motors} motors, the robot has {space.motor_count}")
    return METHODS[method].make(space, seed, sources)
