"""A small quasi-Newton minimiser for smooth functions of few variables: importing scipy's takes longer than a fit."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from vvvaltr.controller.core.arrays import Array

Objective = Callable[[Array], tuple[float, Array]]

LONGEST_STEP = 1.5
"""Longest step, in units of the scaled variables."""

SUFFICIENT_DECREASE = 1e-4
"""Share of the decrease promised by the slope that a step must bring (Armijo's condition)."""

BACKTRACKS, BACKTRACK_FACTOR = 12, 0.3
"""Line search: number of steps to try, and the factor from each to the next."""


def minimise(
    function: Objective, start: Array, hessian: Array, tolerance: float = 5e-3, iterations: int = 50
) -> tuple[Array, float]:
    """Return a local minimum and its value: BFGS with backtracking (Nocedal and Wright 2006, algorithms 6.1 and 3.1).

    No step is longer than 1.5, so scale the variables until a step of 1 is sensible in each.

    Args:
        function: returns value and gradient (k,) at a place (k,); an infinite value says that neither exists there.
        start: place (k,) to start from; the value there must be finite.
        hessian: guess (k, k) of the second derivatives at the start, positive definite.
        tolerance: decrease promised by the quadratic model below which the search ends.
        iterations: maximum number of steps.
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
        inverse_hessian = _update(inverse_hessian, step, new_gradient - gradient)
        place, gradient = place + step, new_gradient
    return place, value


def _line_search(
    function: Objective, place: Array, value: float, direction: Array, slope: float
) -> tuple[Array, float, Array] | None:
    """Return the first step with a sufficient decrease, and value and gradient there; None if there is none."""
    share = min(1.0, LONGEST_STEP / float(np.linalg.norm(direction)))
    for _ in range(BACKTRACKS):
        new_value, new_gradient = function(place + share * direction)
        if new_value <= value + SUFFICIENT_DECREASE * share * slope:
            return share * direction, new_value, new_gradient
        share *= BACKTRACK_FACTOR
    return None


def _update(inverse_hessian: Array, step: Array, change: Array) -> Array:
    """Return the BFGS update of the inverse Hessian; no update where the curvature along the step is not positive."""
    curvature = float(step @ change)
    if curvature <= 1e-10:
        return inverse_hessian
    turned = np.eye(len(step)) - np.outer(step, change) / curvature
    return np.asarray(turned @ inverse_hessian @ turned.T + np.outer(step, step) / curvature)
