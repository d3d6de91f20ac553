"""Long runs and large sources: few fits, bounded matrices, and a continuation with the same bits."""

import dataclasses

import numpy as np
import pytest

from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.protocols import Fitting
from vvvaltr.controller.core.records import Fit, Told
from vvvaltr.controller.core.values import Source
from vvvaltr.transfer.bayes import refitting
from vvvaltr.transfer.bayes.earlier_run import SOURCE_OBSERVATIONS, EarlierRun
from vvvaltr.transfer.bayes.search import Search
from vvvaltr.transfer.methods import guarded
from vvvaltr.transfer.methods.plain_bo import PlainBO
from vvvaltr.transfer.methods.registry import METHODS, make_optimizer

SPACE = GaitSpace.over(3, 4.0, 16.7)


def speed_m_s(gait: Gait, rng: np.random.Generator) -> float:
    hz = np.array(gait.frequency_hz)
    return float(0.02 * np.exp(-((hz - 11.0) ** 2).sum() / 30.0) * np.exp(0.2 * rng.normal()))


def source(trials: int) -> Source:
    rng = np.random.default_rng(1)
    gaits = tuple(Gait(tuple(rng.uniform(3.0, 18.0, 3).tolist())) for _ in range(trials))
    return Source("earlier", gaits, tuple(speed_m_s(gait, rng) for gait in gaits))


def begin(method: str) -> Fitting:
    optimizer = make_optimizer(method, SPACE, 7, [source(20)] if METHODS[method].uses_sources else [])
    assert isinstance(optimizer, Fitting)
    return optimizer


def learn(optimizer: Fitting, trials: int) -> list[Told]:
    history, rng = [], np.random.default_rng(2)
    for _ in range(trials):
        gait = optimizer.ask().gait
        score = speed_m_s(gait, rng)
        optimizer.tell(gait, score)
        history.append(Told(gait, score, optimizer.fit()))
    return history


@pytest.fixture
def early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the rules of long runs begin after 12 trials."""
    monkeypatch.setattr(refitting, "EVERY_TRIAL", 12)
    monkeypatch.setattr(guarded, "EVERY_TRIAL", 12)
    monkeypatch.setattr(refitting, "GROWTH", 0.3)


def new_fits(history: list[Told]) -> list[int]:
    return [i for i, told in enumerate(history, start=1) if told.fit and told.fit.is_new]


@pytest.mark.usefixtures("early")
@pytest.mark.parametrize("method", METHODS)
def test_a_whole_history_with_its_fits_continues_with_the_same_bits(method: str) -> None:
    optimizer = begin(method)
    history = learn(optimizer, 20)
    resumed = begin(method)

    resumed.recall(history)

    assert not (history[-1].fit and history[-1].fit.is_new)
    assert resumed.ask() == optimizer.ask()
    assert resumed.recommend() == optimizer.recommend()
    assert resumed.fit() == optimizer.fit()
    assert learn(resumed, 6) == learn(optimizer, 6)


@pytest.mark.usefixtures("early")
@pytest.mark.parametrize("told", [1, 5, 11, 12, 13])
def test_a_history_ends_anywhere_and_continues_with_the_same_bits(told: int) -> None:
    optimizer, resumed = begin("rgpe"), begin("rgpe")
    history = learn(optimizer, told)

    resumed.recall(history)

    assert resumed.ask() == optimizer.ask()
    assert resumed.recommend() == optimizer.recommend()


@pytest.mark.usefixtures("early")
def test_a_history_is_thinned_alike_before_and_after_a_break(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refitting, "MOST_OBSERVATIONS", 16)
    optimizer, resumed = begin("guarded"), begin("guarded")
    history = learn(optimizer, 34)

    resumed.recall(history)

    assert new_fits(history)[12:] == [18, 25, 32]
    assert resumed.ask() == optimizer.ask()


def test_every_trial_is_a_new_fit_up_to_60_and_every_growth_by_a_tenth_afterwards() -> None:
    fits = new_fits(learn(begin("random"), 100))

    assert fits[:60] == list(range(1, 61))
    assert fits[60:] == [67, 75, 84, 94]


def test_a_surprise_is_a_reason_for_a_new_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refitting, "EVERY_TRIAL", 20)
    monkeypatch.setattr(refitting, "GROWTH", 10.0)
    optimizer, rng = begin("random"), np.random.default_rng(3)
    undisturbed = learn(optimizer, 40)

    fits = []
    for _ in range(10):  # the ground has changed
        optimizer.tell(optimizer.ask().gait, float(rng.uniform(0.1, 0.2)))
        fits.append(optimizer.fit())

    assert max(new_fits(undisturbed)) == 20
    assert any(fit and fit.is_new for fit in fits)


def test_a_history_without_fits_is_told_trial_by_trial() -> None:
    optimizer, resumed = begin("guarded"), begin("guarded")
    history = learn(optimizer, 12)

    resumed.recall([dataclasses.replace(told, fit=None) for told in history])

    assert resumed.ask() == optimizer.ask()


@pytest.mark.parametrize("numbers", [{}, {"signal_variance": 1e300}, {"noise_variance": -1.0}])
def test_a_spoilt_fit_is_made_again(numbers: dict[str, float]) -> None:
    optimizer, resumed = begin("icm"), begin("icm")
    history = learn(optimizer, 8)
    fit = history[-1].fit
    assert fit is not None
    spoilt = Fit({**fit.hyperparameters, **numbers} if numbers else {}, is_new=True)

    resumed.recall([*history[:-1], dataclasses.replace(history[-1], fit=spoilt)])

    assert resumed.ask() == optimizer.ask()


def test_recalling_forgets_what_was_told_before() -> None:
    optimizer, resumed = begin("efficient"), begin("efficient")
    history = learn(optimizer, 5)
    learn(resumed, 3)

    resumed.recall(history)

    assert resumed.ask() == optimizer.ask()


@pytest.mark.usefixtures("early")
def test_no_matrix_grows_with_a_long_history(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(refitting, "MOST_OBSERVATIONS", 40)
    long, optimizer = source(200), PlainBO(SPACE, 1)

    optimizer.recall([Told(gait, score) for gait, score in zip(long.gaits, long.scores, strict=True)])

    belief = optimizer._belief
    assert belief is not None and isinstance(belief.fitted, refitting.Conditioned)
    assert belief.fitted.told == 200
    assert 40 <= len(belief.fitted.process.inverse_root) <= 40 + 12


@pytest.mark.parametrize("trials", [2000, 20_000])
def test_a_large_source_is_thinned(trials: int) -> None:
    run = EarlierRun.learn(SPACE, 0, source(trials))

    truth = speed_m_s(Gait((11.0, 11.0, 11.0)), np.random.default_rng(0))
    assert len(run.trials) == len(run.process.inverse_root) == SOURCE_OBSERVATIONS
    assert run.predict(np.array([SPACE.to_unit(Gait((11.0, 11.0, 11.0)))]))[0] == pytest.approx(truth, rel=0.3)


def test_a_source_of_60_trials_is_left_as_it_is() -> None:
    run = EarlierRun.learn(SPACE, 0, source(60), most=60)

    assert list(run.trials.scores) == list(source(60).scores)


def test_a_suggestion_is_made_once_between_two_trials() -> None:
    asked = []
    search = begin("plain")
    assert isinstance(search, Search)
    propose = search._propose
    search._propose = lambda *given: asked.append(1) or propose(*given)  # type: ignore[func-returns-value]

    search.ask()
    search.improvement()
    search.ask()

    assert len(asked) == 1
