"""A peer behind ask and tell, in its own environment: commands and answers are JSON lines.

python peer_process.py botorch|scikit-optimize
"""

from __future__ import annotations

import json
import sys
import time
import warnings
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

INITIAL_TRIALS = 8


class Peer(Protocol):
    """An optimiser that maximises over the unit cube."""

    def ask(self, x: Array, y: Array, source: tuple[Array, Array] | None) -> Array:
        """Return the next place (d,), from places (n, d), values (n,) and, for a transfer, those of a source."""
        ...

    def recommend(self, x: Array, y: Array) -> Array:
        """Return the place (d,) of the greatest posterior mean."""
        ...


class BoTorch:
    """BoTorch with its noisy expected improvement (in logarithms), as its tutorials set it up.

    A source makes the model a multi-task Gaussian process.
    """

    def __init__(self, dimension: int, seed: int) -> None:
        import torch

        torch.set_num_threads(1)
        torch.manual_seed(seed)
        self._dimension = dimension
        self._design = torch.quasirandom.SobolEngine(dimension, scramble=True, seed=seed).draw(INITIAL_TRIALS).numpy()

    def ask(self, x: Array, y: Array, source: tuple[Array, Array] | None) -> Array:
        """See Peer."""
        import torch
        from botorch.acquisition.logei import qLogNoisyExpectedImprovement

        if len(x) < INITIAL_TRIALS:
            return np.asarray(self._design[len(x)], float)
        seen = torch.tensor(x)
        acquisition = qLogNoisyExpectedImprovement(self._model(x, y, source), seen, prune_baseline=True)
        return self._maximum(acquisition)

    def recommend(self, x: Array, y: Array) -> Array:
        """See Peer."""
        from botorch.acquisition import PosteriorMean

        return self._maximum(PosteriorMean(self._model(x, y, None)))

    def _model(self, x: Array, y: Array, source: tuple[Array, Array] | None) -> Any:
        import torch
        from botorch.fit import fit_gpytorch_mll
        from botorch.models import MultiTaskGP, SingleTaskGP
        from botorch.models.transforms import Standardize
        from gpytorch.mlls import ExactMarginalLogLikelihood

        scaled = Standardize(m=1)
        if source is None:
            model = SingleTaskGP(torch.tensor(x), torch.tensor(y)[:, None], outcome_transform=scaled)
        else:
            tasks = np.repeat([0.0, 1.0], [len(source[0]), len(x)])[:, None]
            places = np.hstack([np.vstack([source[0], x]), tasks])
            values = np.concatenate([source[1], y])[:, None]
            model = MultiTaskGP(
                torch.tensor(places),
                torch.tensor(values),
                task_feature=-1,
                output_tasks=[1],
                outcome_transform=scaled,
            )
        fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
        return model

    def _maximum(self, acquisition: Any) -> Array:
        import torch
        from botorch.optim import optimize_acqf

        bounds = torch.tensor([[0.0] * self._dimension, [1.0] * self._dimension], dtype=torch.float64)
        place, _ = optimize_acqf(acquisition, bounds=bounds, q=1, num_restarts=10, raw_samples=512)
        return np.asarray(place[0].numpy())


class ScikitOptimize:
    """scikit-optimize with its defaults: a Gaussian process and a portfolio of acquisitions. It has no transfer."""

    def __init__(self, dimension: int, seed: int) -> None:
        self._dimension, self._seed = dimension, seed
        self._optimizer = self._fresh()
        self._told = 0

    def ask(self, x: Array, y: Array, source: tuple[Array, Array] | None) -> Array:
        """See Peer."""
        if source is not None:
            x, y = np.vstack([source[0], x]), np.concatenate([source[1], y])
            self._optimizer, self._told = self._fresh(), 0
        if new := [(list(place), -value) for place, value in zip(x, y, strict=True)][self._told :]:
            self._optimizer.tell(*map(list, zip(*new, strict=True)))
            self._told += len(new)
        return np.array(self._optimizer.ask())

    def recommend(self, x: Array, y: Array) -> Array:
        """See Peer; here it is the best of the places seen."""
        self.ask(x, y, None)
        model, space = self._optimizer.models[-1], self._optimizer.space
        means = model.predict(space.transform([list(place) for place in x]))
        return np.asarray(x[int(np.argmin(means))])

    def _fresh(self) -> Any:
        from skopt import Optimizer

        return Optimizer(
            [(0.0, 1.0)] * self._dimension,
            base_estimator="GP",
            n_initial_points=INITIAL_TRIALS,
            initial_point_generator="lhs",
            random_state=self._seed,
        )


PEERS: dict[str, type[BoTorch] | type[ScikitOptimize]] = {"botorch": BoTorch, "scikit-optimize": ScikitOptimize}


def answer(peer: Peer, command: dict[str, Any]) -> dict[str, Any]:
    """Execute one command, and return the place and the processor time in seconds."""
    x, y = np.array(command["x"]), np.array(command["y"])
    start_s = time.process_time()
    if command["do"] == "recommend":
        place = peer.recommend(x, y)
    else:
        source = command.get("source")
        place = peer.ask(x, y, source and (np.array(source["x"]), np.array(source["y"])))
    return {"x": np.clip(place, 0.0, 1.0).tolist(), "seconds": time.process_time() - start_s}


def main() -> None:
    """Serve until the input ends."""
    warnings.simplefilter("ignore")
    make = PEERS[sys.argv[1]]
    peer: Peer = make(1, 0)
    for line in sys.stdin:
        command = json.loads(line)
        if command["do"] == "begin":
            peer = make(command["dimension"], command["seed"])
            print("{}", flush=True)
        else:
            print(json.dumps(answer(peer, command)), flush=True)


if __name__ == "__main__":
    main()
