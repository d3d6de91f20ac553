import math

import numpy as np
import pytest

from vvvaltr.controller.core.arrays import Array
from vvvaltr.transfer.bayes.minimise import minimise


def bowl(place: Array) -> tuple[float, Array]:
    scales = np.array([1.0, 9.0, 0.3])
    return float(0.5 * scales @ (place - 1.0) ** 2), scales * (place - 1.0)


def valley(place: Array) -> tuple[float, Array]:
    """Rosenbrock's function: a bent valley with its minimum at (1, 1)."""
    x, y = place
    return (1 - x) ** 2 + 100 * (y - x * x) ** 2, np.array([-2 * (1 - x) - 400 * x * (y - x * x), 200 * (y - x * x)])


def test_the_bottom_of_a_bowl_is_found_with_and_without_a_good_guess_of_its_shape() -> None:
    for hessian in (np.eye(3), np.diag([1.0, 9.0, 0.3])):
        place, value = minimise(bowl, np.array([-1.0, 2.0, 3.0]), hessian, tolerance=1e-12)
        assert place == pytest.approx(np.ones(3), abs=1e-4)
        assert value == pytest.approx(0.0, abs=1e-9)


def test_a_bent_valley_is_followed_to_its_end() -> None:
    place, _ = minimise(valley, np.array([-1.2, 1.0]), np.eye(2), tolerance=1e-12, iterations=200)
    assert place == pytest.approx(np.ones(2), abs=1e-4)


def test_places_without_a_value_are_stepped_back_from() -> None:
    def fenced(place: Array) -> tuple[float, Array]:
        if place[0] <= 0.0:
            return math.inf, np.zeros(1)
        return float(place[0] - math.log(place[0])), 1.0 - 1.0 / place

    place, _ = minimise(fenced, np.array([3.0]), np.array([[0.2]]), tolerance=1e-10)
    assert place[0] == pytest.approx(1.0, abs=1e-3)


def test_a_start_at_the_minimum_stays_there() -> None:
    place, value = minimise(bowl, np.ones(3), np.eye(3))
    assert (list(place), value) == ([1.0] * 3, 0.0)
