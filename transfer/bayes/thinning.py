"""Fewer observations in place of many trials, so that the cost of a trial stays bounded however many there were.

Nothing is left out: trials of like gaits are merged into their mean, which has so much less noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.scale import Scale
from vvvaltr.transfer.bayes.trials import Trials

KEPT_SHARE = 0.1
"""Share of the observations that are the best trials, and share that are the latest ones."""


def thin(trials: Trials, most: int) -> Trials:
    """Return trials as ``most`` observations, or as they are where there are no more than that.

    A tenth of the observations are the trials with the best scores, another tenth the latest ones: around them the
    search goes on, so they stay single. The others are merged around places spread as far apart as possible
    (farthest-first traversal: Gonzalez 1985). k merged trials become one observation at their mean place, with the mean
    of their standardised scores and 1 / k of the noise.
    """
    if len(trials) <= most:
        return trials
    kept = int(KEPT_SHARE * most)
    order = np.argsort(-trials.scores, kind="stable")
    single = np.zeros(len(trials), dtype=bool)
    single[order[:kept]] = single[-kept:] = True
    others = trials.part(~single)
    labels = assign(others.x, spread(others.x, most - int(single.sum())))
    return merge(others, labels, Scale.of(trials.scores)).then(trials.part(single))


def spread(x: Array, count: int) -> NDArray[np.intp]:
    """Return up to ``count`` of the places (n, d), as indices: the first, then each time the farthest from all chosen.

    They are fewer where there are not so many different places.
    """
    chosen = [0]
    distances = _squares(x, x[0])
    while len(chosen) < count and distances.max() > 0.0:
        chosen.append(int(np.argmax(distances)))
        distances = np.minimum(distances, _squares(x, x[chosen[-1]]))
    return np.array(chosen)


def assign(x: Array, centres: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the nearest centre's position (n,) in ``centres`` for each of the places (n, d)."""
    labels, nearest = np.zeros(len(x), dtype=np.intp), np.full(len(x), np.inf)
    for label, centre in enumerate(centres):  # one at a time, so that no matrix of all distances is needed
        distances = _squares(x, x[centre])
        closer = distances < nearest
        labels[closer], nearest[closer] = label, distances[closer]
    return labels


def merge(trials: Trials, labels: NDArray[np.intp], scale: Scale) -> Trials:
    """Return one observation for each label: the mean of its trials, each of which must have the noise of one trial."""
    sizes = np.bincount(labels)
    x = np.stack([np.bincount(labels, column) for column in trials.x.T], axis=1) / sizes[:, None]
    y = np.bincount(labels, scale.standardise(trials.scores)) / sizes
    return Trials(x, scale.scores(y), 1.0 / sizes)


def _squares(x: Array, place: Array) -> Array:
    return np.asarray(((x - place) ** 2).sum(axis=1))
