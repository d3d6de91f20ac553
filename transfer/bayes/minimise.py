"""A small quasi-Newton minimiser for smooth functions of a few variables; importing scipy's costs more than a fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vvvaltr.controller.core.arrays import Array

Objective = Callable[[Array], tuple[float, Array]]

LONGEST_STEP = 1.5
ENOUGH_DECREASE = 1e-4


def minimise(
    function: Objective, start: Array, hessian: Array, tolerance: float = 5e-3, iterations: int = 50
) -> tuple[Array, float]:
    """Return a local minimum and its value: BFGS with backtracking (Nocedal and Wright 2006, algorithms 6.1 and 3.1).

    Scale the variables so that a step of 1 is sensible in each: no step is longer than 1.5.

    Args:
        function: returns value and gradient; an infinite value marks a place where it does not exist.
        start: (k,) where to begin; the value there must be finite.
        hessian: (k, k) a guess of the second derivatives there, positive definite.
        tolerance: stop when the quadratic model promises a smaller decrease than this.
        iterations: the most steps to take.
    """
    place, (value, gradient) = start, function(start)
    inverse_hessian = np.asarray(np.linalg.inv(hessian), dtype=np.float64)
    for _ in range(iterations):
        direction = -inverse_hessian @ gradient
        slope = float(gradient @ direction)
        if -slope < 2.0 * tolerance:
            break
        found = _line_search(function, place, value, direction, slope)
        if found is None:
            break
        step, value, new_gradient = found
        inverse_hessian = _updated(inverse_hessian, step, new_gradient - gradient)
        place, gradient = place + step, new_gradient
    return place, value


def _line_search(
    function: Objective, place: Array, value: float, direction: Array, slope: float
) -> tuple[Array, float, Array] | None:
    """Return the first step that decreases enough (Armijo), with value and gradient there; None if none does."""
    share = min(1.0, LONGEST_STEP / float(np.linalg.norm(direction)))
    for _ in range(12):
        new_value, new_gradient = function(place + share * direction)
        if new_value <= value + ENOUGH_DECREASE * share * slope:
            return share * direction, new_value, new_gradient
        share *= 0.3
    return None


def _updated(inverse_hessian: Array, step: Array, change: Array) -> Array:
    """Return the BFGS update of the inverse Hessian, left alone where the curvature along the step is not positive."""
    curvature = float(step @ change)
    if curvature <= 1e-10:
        return inverse_hessian
    turned = np.eye(len(step)) - np.outer(step, change) / curvature
    return np.asarray(turned @ inverse_hessian @ turned.T + np.outer(step, step) / curvature)
