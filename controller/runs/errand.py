"""What a run of going somewhere is to do, as it stands beside the run's log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec

from vvvaltr.controller.core.disk import read_bytes
from vvvaltr.controller.core.errors import UserError
from vvvaltr.transfer.steering.planner import Goal

Above0 = Annotated[float, msgspec.Meta(gt=0.0)]


class Errand(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a run of going somewhere is to do.

    Args:
        goals: x, y and heading of each; the heading is None where any will do.
        within_m: how near is near enough.
        within_rad: how near to the heading is near enough.
        budget_s: driving time for each goal.
    """

    goals: Annotated[tuple[tuple[float, float, float | None], ...], msgspec.Meta(min_length=1)]
    within_m: Above0 = 0.02
    within_rad: Above0 = 0.2
    budget_s: Above0 = 200.0

    @property
    def targets(self) -> tuple[Goal, ...]:
        """The goals as the planner takes them."""
        return tuple(Goal(x_m, y_m, self.within_m, yaw_rad, self.within_rad) for x_m, y_m, yaw_rad in self.goals)


def load_errand(run: Path) -> Errand:
    """Return the errand of the run in directory ``run``. Raises UserError if there is none, or it is damaged."""
    path = run / "errand.json"
    try:
        return msgspec.json.decode(read_bytes(path), type=Errand)
    except (msgspec.DecodeError, msgspec.ValidationError, OSError, RecursionError) as error:
        raise UserError(f"{path}: {error}; restore the file as the run wrote it") from None
