"""Hypotheses that differ in their trend alone: one root says the same of many places as the roots of all."""

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import GaitSpace
from vvvaltr.transfer.bayes.alike import Alike
from vvvaltr.transfer.bayes.drive import Drive
from vvvaltr.transfer.bayes.driven import Driven
from vvvaltr.transfer.bayes.refitting import Conditioned
from vvvaltr.transfer.bayes.trials import Trials
from vvvaltr.transfer.methods.drive import Hypotheses, learn_driven

SPACE = GaitSpace.over(3, -20.0, 20.0)


@pytest.fixture(scope="module", params=[8, 130])
def hypotheses(request: pytest.FixtureRequest) -> Hypotheses:
    rng, drive = np.random.default_rng(4), Drive.of(SPACE)
    x = rng.random((request.param, 3))
    x[:4, 0] = x[:4, 1] = 0.9
    scores = np.abs(x - 0.5).sum(axis=1) + 0.2 * rng.normal(size=request.param)
    belief = learn_driven(SPACE, drive, Trials(x, scores), None, rng)
    assert isinstance(belief.fitted, Conditioned) and belief.drive is not None
    assert 0.0 < belief.drive.beats(x).mean() < 1.0
    return Hypotheses.of(belief.drive, belief.fitted.others)


@pytest.mark.parametrize("chances", [(0.6, 0.3, 0.1), (0.1, 0.2, 0.7), (1.0,)])
def test_one_root_predicts_what_the_roots_of_all_hypotheses_do(hypotheses: Hypotheses, chances: tuple[float]) -> None:
    places = [0, 2, 4][: len(chances)]
    which = np.array(chances), [hypotheses.zones[i] for i in places], [hypotheses.processes[i] for i in places]
    one, all_roots = Alike.of(hypotheses.drive, *which), Driven.of(hypotheses.drive, *which)
    x = np.random.default_rng(5).random((300, 3))

    for mine, usual in zip(one.predict(x), all_roots.predict(x), strict=True):
        assert mine == pytest.approx(usual, rel=1e-9, abs=1e-9)
    assert one.predict_mean(x) == pytest.approx(one.predict(x)[0], rel=1e-12, abs=1e-12)
    gradient = one.predict_mean_with_gradient(x[:4])[1]
    step = 1e-6 * np.array([0.0, 1.0, 0.0])
    assert gradient[:, 1] == pytest.approx((one.predict_mean(x[:4] + step) - one.predict_mean(x[:4] - step)) / 2e-6)
