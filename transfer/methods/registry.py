"""All methods by name. A method is a file of this folder that ends in its row, ``METHOD``, and a line of the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from vvvaltr.controller.core.ask_tell import complete
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.plug_ins import Registry
from vvvaltr.controller.core.protocols import Optimizer
from vvvaltr.controller.core.spelling import unknown
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.methods import (
    drive,
    efficient_bo,
    guarded,
    icm,
    optimistic,
    plain_bo,
    random_search,
    rgpe,
    warm,
)
from vvvaltr.transfer.methods.method import Method

BUILT_IN = (
    drive.METHOD,
    plain_bo.METHOD,
    efficient_bo.METHOD,
    guarded.METHOD,
    warm.METHOD,
    rgpe.METHOD,
    icm.METHOD,
    optimistic.METHOD,
    random_search.METHOD,
)
"""The methods of this package, in the order in which help and reports list them."""

METHODS: Mapping[str, Method] = MappingProxyType({method.name: method for method in BUILT_IN})

REGISTRY: Registry[Method] = Registry("method", "vvvaltr.methods", Method, METHODS)
"""These methods and those of installed packages, which add one by an entry point of the group ``vvvaltr.methods``."""


def make_optimizer(method: str, space: GaitSpace, seed: int, sources: Sequence[Source] = ()) -> Optimizer:
    """Return a new optimiser of the method called ``method``, which has been told nothing yet.

    Args:
        method: name of the method, as in ``REGISTRY``.
        space: gaits to search.
        seed: seed of every random stream of the optimiser.
        sources: earlier runs to learn from.

    Raises:
        UserError: the package that adds the method is broken.
        ValueError: there is no such method, it needs a source or takes none, or a source has another number of motors
            than the space.
    """
    if method not in REGISTRY:
        raise ValueError(unknown("method", method, REGISTRY.names))
    entry = REGISTRY.named(method)
    if entry.uses_sources and not sources:
        raise ValueError(f"method {method!r} learns from an earlier run: give it a source")
    if sources and not entry.uses_sources:
        able = ", ".join(name for name, known in METHODS.items() if known.uses_sources)
        raise ValueError(f"method {method!r} takes no source: leave the source out, or choose one of {able}")
    for source in sources:
        motors = source.gaits[0].motor_count
        if any(gait.motor_count != space.motor_count for gait in source.gaits):
            raise ValueError(f"source {source.name} is of {motors} motors, the robot has {space.motor_count}")
    return complete(entry.make(space, seed, sources))
