"""The innermost loop of the planar twin, past pymunk's Python layer.

The layer's vectors, checks and bookkeeping would double the time of a step. The forces of many steps are therefore
written at once into memory that the C library reads, and each step makes only the library's two calls. The motion is
the same as with pymunk's own calls, which the tests check.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pymunk

STEPS_AT_ONCE = 50
"""Number of steps whose forces fit into the memory."""


class Stepper:
    """Steps a space and applies forces to some of its bodies.

    Args:
        space: space to step.
        pushed: bodies to push, each at its middle and in its own frame.
        time_step_s: time step of the integration.
    """

    def __init__(self, space: pymunk.Space, pushed: Sequence[pymunk.Body], time_step_s: float) -> None:
        from pymunk._chipmunk_cffi import ffi, lib

        self._calls = lib.cpBodyApplyForceAtLocalPoint, lib.cpSpaceStep
        self._space, self._time_step_s = space, time_step_s
        self._middle = ffi.new("cpVect *")[0]
        self._memory = ffi.new("cpVect[]", STEPS_AT_ONCE * len(pushed))
        cells = iter(self._memory)
        self._rows = [[(body._body, next(cells)) for body in pushed] for _ in range(STEPS_AT_ONCE)]
        self._forces_n = np.frombuffer(ffi.buffer(self._memory), complex).reshape(STEPS_AT_ONCE, len(pushed))

    def run(self, forces_n: NDArray[np.complex128]) -> None:
        """Make a step for each row of forces x + iz in newtons, shape (steps, bodies), steps <= STEPS_AT_ONCE."""
        apply_force, step = self._calls
        space, time_step_s, middle = self._space._space, self._time_step_s, self._middle
        self._forces_n[: len(forces_n)] = forces_n
        for row in self._rows[: len(forces_n)]:
            for body, force_n in row:
                apply_force(body, force_n, middle)
            step(space, time_step_s)
