"""A campaign: every method on every experiment, repeated, in processes or on a cluster. It can be continued."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from dataclasses import dataclass, replace

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.experiments.store import Store
from vvvaltr.transfer.experiments.thesis import Pair, list_pairs
from vvvaltr.transfer.experiments.unit import Result, Settings, Unit, work
from vvvaltr.transfer.methods.registry import METHODS

REPLICATES = 3
"""Number of runs of Plain-BO per repeat: a single lucky one would bias every comparison of its repeat."""

CHECKPOINTS = (5, 10, 20)
"""Trials after which the true speed of the recommended gait is measured, beside the last trial."""

Progress = Callable[[Iterable["Future[Result]"], int], Iterable["Future[Result]"]]
"""Wraps a stream of finished units, given their total number, to show the progress."""


@dataclass(frozen=True, slots=True)
class PairUnits:
    """All units of one repeat of an experiment.

    Args:
        pair: the experiment.
        source: run on the source, to learn from.
        plain: runs of Plain-BO on the target.
        methods: run of each other method on the target, by name.
    """

    pair: Pair
    source: Unit
    plain: tuple[Unit, ...]
    methods: dict[str, Unit]


def list_transfer_methods() -> tuple[str, ...]:
    """Return the names of all methods to compare with Plain-BO."""
    return tuple(name for name in METHODS if name != "plain")


def list_checkpoints(trials: int) -> tuple[int, ...]:
    """Return the checkpoints of a run of ``trials`` trials; the last one is its end."""
    return (*(after for after in CHECKPOINTS if after < trials), trials)


def plan_checkpoints(pair: Pair, settings: Settings) -> tuple[int, ...]:
    """Return the checkpoints of an experiment in a campaign with these settings."""
    return list_checkpoints(min(pair.trials, settings.most_trials or pair.trials))


def plan_units(pair: Pair, settings: Settings, repeat: int, methods: Sequence[str]) -> PairUnits:
    """Return the units of one repeat of an experiment; repeats are counted from 1.

    Experiments with the same target share the units that do not depend on the source, and experiments with the same
    source share the source's run. A shared unit is as long as the longest experiment needs; see ``Result.until``.
    """
    every = list_pairs(settings.robot)
    afters = plan_checkpoints(pair, settings)
    source_trials = max(plan_checkpoints(it, settings)[-1] for it in every if it.source == pair.source)
    alone_afters = sorted(
        {after for it in every if it.target == pair.target for after in plan_checkpoints(it, settings)}
    )
    source = Unit(pair.source, "plain", source_trials, repeat, role="source")
    alone = Unit(pair.target, "plain", alone_afters[-1], repeat, role="target1", checkpoints=tuple(alone_afters))

    def by(method: str) -> Unit:
        unit = replace(alone, method=method)
        if not METHODS[method].uses_sources:
            return unit
        unit = replace(unit, inverted=pair.inverted, shuffled=pair.shuffled)
        return replace(unit, trials=afters[-1], checkpoints=afters, source=source)

    return PairUnits(
        pair,
        source,
        plain=tuple(replace(alone, role=f"target{replicate + 1}") for replicate in range(REPLICATES)),
        methods={method: by(method) for method in methods},
    )


def run_campaign(
    store: Store, chosen: Sequence[Pair], repeats: int, methods: Sequence[str], executor: Executor, progress: Progress
) -> None:
    """Do all units that are not done yet, and store each one as it is finished.

    Args:
        store: campaign on disk.
        chosen: experiments to run.
        repeats: number of repeats of each experiment.
        methods: names of the methods to compare with Plain-BO.
        executor: workers.
        progress: shows the progress.

    Raises:
        UserError: a worker died.
        RuntimeError: a unit failed.
    """
    all_units = [
        plan_units(pair, store.settings, repeat, methods) for repeat in range(1, repeats + 1) for pair in chosen
    ]
    sources = _list_missing(store, (units.source for units in all_units))
    _work_through(store, sources, executor, progress)
    targets = _list_missing(store, (unit for units in all_units for unit in (*units.plain, *units.methods.values())))
    _work_through(store, targets, executor, progress)


def _list_missing(store: Store, units: Iterable[Unit]) -> list[Unit]:
    return [unit for name, unit in {unit.name: unit for unit in units}.items() if not store.has(unit)]


def _work_through(store: Store, units: Sequence[Unit], executor: Executor, progress: Progress) -> None:
    pending = {executor.submit(work, store.settings, unit, _load_source(store, unit)): unit for unit in units}
    for finished in progress(as_completed(pending), len(pending)):
        try:
            store.save(pending[finished], finished.result())
        except BrokenExecutor:
            raise UserError("a worker died, perhaps for lack of memory: continue with fewer --jobs") from None


def _load_source(store: Store, unit: Unit) -> Source | None:
    if unit.source is None:
        return None
    run = store.load(unit.source).until((unit.trials,))
    return run.source(unit.source.condition.name, unit.inverted, unit.shuffled)
