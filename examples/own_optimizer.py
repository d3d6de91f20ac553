"""An optimiser of one's own: it climbs from the best gait so far by smaller and smaller steps. Ask and tell suffice."""

import numpy as np

import vvvaltr


class HillClimber:
    """Tries gaits around the best one so far."""

    def __init__(self, space: vvvaltr.GaitSpace, seed: int) -> None:
        self._space = space
        self._random = np.random.default_rng(seed)
        self._best_score, self._best_place = -np.inf, np.full(space.dimension, 0.5)
        self._step = 0.4

    def ask(self) -> vvvaltr.Suggestion:
        """Return a gait near the best one."""
        place = self._best_place + self._random.normal(0.0, self._step, self._space.dimension)
        return vvvaltr.Suggestion(self._space.from_unit(np.clip(place, 0.0, 1.0)), "hill climbing")

    def tell(self, gait: vvvaltr.Gait, score: float) -> None:
        """Move to the gait if it was faster."""
        if score > self._best_score:
            self._best_score, self._best_place = score, self._space.to_unit(gait)
        self._step *= 0.9


with vvvaltr.open_robot("planar", seed=1) as robot:
    climber = HillClimber(robot.space, seed=1)
    for logged in vvvaltr.learn(robot, climber, trials=30, confirm=(3, 4)):
        if logged.score is not None:  # a trial that failed has none
            print(f"trial {logged.trial.number:2}: {logged.trial.gait}: {1000 * logged.score:.1f} mm/s")
if best := logged.recommendation:  # what the repeats at the end say, not the luckiest trial
    print(f"best gait: {best.gait}, {1000 * best.estimate.mean:.1f} mm/s expected")
