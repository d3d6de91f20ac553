"""Drive-BO: Bayesian optimisation that expects more drive to move more, as far as the trials bear it out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.controller.core.streams import stream
from vvvaltr.transfer.bayes.alike import Alike
from vvvaltr.transfer.bayes.belief import Belief, refit
from vvvaltr.transfer.bayes.drive import Drive, places_on_bounds
from vvvaltr.transfer.bayes.driven import Driven, begin_at_rest, observe_drive, observe_each, rise_of
from vvvaltr.transfer.bayes.gp import GaussianProcess
from vvvaltr.transfer.bayes.initial_design import propose_design
from vvvaltr.transfer.bayes.proposal import Proposal, begin_with
from vvvaltr.transfer.bayes.refitting import Conditioned, Fitted, follow, goes_on
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.method import Method
from vvvaltr.transfer.methods.plain_bo import INITIAL_TRIALS

DEAD_ZONES = (0.0, 0.3, 0.5, 0.6, 0.7)
"""Frequencies, as shares of the greatest, below which a motor may do nothing. They are equally probable at first."""

MOST_HYPOTHESES, LEAST_CHANCE = 3, 0.03
"""Hypotheses that predict: the most probable ones, and none below this probability. Others cost time, change little."""

FIRST_PLACES = 200
"""Number of places on faces, edges and corners of the unit cube that the first gait is sought among."""

DEAD_ZONE = "dead_zone"
"""Name of the most probable dead zone in a fit."""


class DriveBO(Search):
    """Bayesian optimisation with a mean that rises with the drive beyond a dead zone.

    How much the mean rises is a coefficient with a wide prior, and the dead zone is one of several, each weighed by how
    well it explains the trials: data decide about both. There is no initial design. The first gait is one of the
    strongest, and from the second trial on the expected improvement decides. See ``Drive``. With all motors off the
    score is known to be 0.

    Where no frequency is searched, a drive has no meaning. The first trials are then spread over the space, as in
    Plain-BO.

    Args:
        space: gaits to search.
        seed: seed of every random stream.
        has_drive: False where the frequencies are mere numbers, of which nothing is expected.
    """

    def __init__(self, space: GaitSpace, seed: int, has_drive: bool = True) -> None:
        drive = Drive.of(space) if has_drive else Drive.of(space).without_meaning()
        first = propose_first(drive, space.dimension, seed)
        super().__init__(space, seed, partial(learn_driven, space, drive), begin_with(first))


def propose_first(drive: Drive, dimension: int, seed: int) -> list[Proposal]:
    """Return the first proposals: a gait of the strongest drive, or without a drive some that are spread out."""
    if not drive.has_meaning:
        return propose_design(INITIAL_TRIALS, dimension, stream(seed, 0, "initial design"))
    rng = stream(seed, 0, "strongest drive")
    x = drive.move_apart(places_on_bounds(FIRST_PLACES, dimension, rng), rng)
    return [Proposal(x[np.argmax(drive.trend(x, np.zeros(1))[0])], "strongest drive")]


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """What the trials say under each of the dead zones.

    Args:
        drive: drive of the space.
        zones: the dead zones.
        processes: process of each.
    """

    drive: Drive
    zones: tuple[float, ...]
    processes: tuple[GaussianProcess, ...]

    @classmethod
    def condition(cls, drive: Drive, fitted: Conditioned, scale: Scale, last: Fitted | None, zone: float) -> Hypotheses:
        """Return the hypotheses given the rows of a fit: the processes of the ``last`` one extended, or else new ones.

        The fit's own process, with the dead zone ``zone``, is one of them.
        """
        zones = list_zones(drive)
        others = [place for place, each in enumerate(zones) if each != zone]
        rows = observe_each(drive, fitted.rows, scale, [zones[place] for place in others])
        if goes_on(last, fitted):
            found = [last.others[place].extend(it) for place, it in zip(others, rows, strict=True)]
        else:
            found = GaussianProcess.condition_each(rows, fitted.hyperparameters) if rows else []
        known = dict(zip(others, found, strict=True))
        return cls.of(drive, [known.get(place, fitted.process) for place in range(len(zones))])

    @classmethod
    def of(cls, drive: Drive, processes: Sequence[GaussianProcess]) -> Hypotheses:
        """Return the hypotheses whose processes are the first of ``processes``."""
        zones = list_zones(drive)
        return cls(drive, zones, tuple(processes[: len(zones)]))

    def evidence(self, given: int = 0) -> Array:
        """Return the log evidence (h,) of each, of all values but the first ``given``."""
        return np.array([process.log_evidence(given) for process in self.processes])

    def mean_evidence(self, given: int) -> float:
        """Return the log of the evidence, after the first values, of all together, equally probable at first."""
        evidence = self.evidence(given)
        return float(evidence.max() + np.log(np.exp(evidence - evidence.max()).mean()))

    def chances(self) -> Array:
        """Return the probability (h,) of each."""
        evidence = self.evidence()
        chances = np.exp(evidence - evidence.max())
        return np.asarray(chances / chances.sum())

    def posterior(self) -> Driven:
        """Return the mixture of the most probable ones."""
        chances = self.chances()
        kept = np.sort(np.argsort(-chances, kind="stable")[:MOST_HYPOTHESES])
        kept = kept[chances[kept] >= min(LEAST_CHANCE, chances.max())]
        shares = chances[kept] / chances[kept].sum()
        return Alike.of(self.drive, shares, [self.zones[i] for i in kept], [self.processes[i] for i in kept])

    def best(self) -> int:
        """Return the position of the most probable one."""
        return int(np.argmax(self.evidence()))


def list_zones(drive: Drive) -> tuple[float, ...]:
    """Return the dead zones that are thought of: none but 0 where a drive has no meaning."""
    return DEAD_ZONES if drive.has_meaning else DEAD_ZONES[:1]


def learn_driven(
    space: GaitSpace, drive: Drive, trials: Trials, last: Fitted | None, rng: np.random.Generator
) -> Belief:
    """Return what one or more trials say by themselves, with the drive and dead zone that they bear out."""
    scale = Scale.of(begin_at_rest(drive, trials).scores)
    zone = 0.0 if last is None else last.learned[DEAD_ZONE]
    fitted = follow(
        trials,
        last,
        lambda rows: observe_drive(drive, rows, scale, zone),
        partial(refit, trials=len(trials), rng=rng, follows=True),
    )
    hypotheses = Hypotheses.condition(drive, fitted, scale, last, zone)
    fitted = replace(fitted, others=hypotheses.processes)
    if not goes_on(last, fitted):
        best = hypotheses.best()
        fitted = replace(fitted, process=hypotheses.processes[best], learned={DEAD_ZONE: hypotheses.zones[best]})
    return believe(space, scale, fitted, hypotheses)


def believe(space: GaitSpace, scale: Scale, fitted: Conditioned, hypotheses: Hypotheses) -> Belief:
    """Return the belief in a mixture of hypotheses."""
    belief = Belief.of(fitted.process, scale, space, fitted)
    names = dict(belief.hyperparameters)
    if hypotheses.drive.has_meaning:
        best = hypotheses.best()
        names |= {
            "dead_zone_hz": hypotheses.zones[best] * hypotheses.drive.greatest_hz,
            "drive": rise_of(hypotheses.processes[best]),
        }
    return replace(
        belief,
        posterior=hypotheses.posterior(),
        seen=fitted.rows.x,
        hyperparameters=names,
        drive=hypotheses.drive,
    )


METHOD = Method(
    "drive",
    "Bayesian optimisation that expects more drive to move more, as far as the trials bear it out",
    uses_sources=False,
    make=lambda space, seed, _: DriveBO(space, seed),
)
"""The default without a source."""
