"""Who is beside the robot of a run."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from vvvaltr.controller.core.attending import Operator
from vvvaltr.controller.core.errors import one_line_errors
from vvvaltr.controller.loop.attendance import Attendance
from vvvaltr.controller.loop.putting_back import Placement, Reposition
from vvvaltr.controller.robot.opening import Rig

_LEAST_BYTES = 8_000_000  # of some trials with pictures
_REVIEW_S = 3.0  # how long the operator may think about a trial before it is kept


@dataclass(frozen=True, slots=True)
class Attended:
    """Who is beside the robot.

    Args:
        operator: the person; None for nobody.
        reposition: when the robot is put back; None for before each trial where its file has a start, and else at the
            border of its arena. A twin is put back as its scatter says, and not otherwise.
        has_hand: whether the hand of a mock may be asked.
        park_after_s: how long a pause lasts until the motors' lines are let go.
    """

    operator: Operator | None = None
    reposition: Reposition | None = None
    has_hand: bool = True
    park_after_s: float = 60.0


def make_attendance(rig: Rig, attended: Attended, is_twin: bool, folder: Path) -> Attendance:
    """Return what a run on this rig waits for. Raises UserError where the robot cannot be put back as asked."""
    with one_line_errors():
        if is_twin and attended.reposition is not None:
            raise ValueError("a twin is put back, or left, as its --scatter says: leave out --reposition")
        arena = rig.settings.arena
        if is_twin:
            placement = Placement()
        elif attended.reposition is None:
            placement = Placement.usual(rig.start, arena)
        else:
            placement = Placement(attended.reposition, rig.start, arena)
    hand = rig.hand if attended.has_hand else None
    # Beside a mock with a hand a person only looks on: nobody is waited for.
    review_s = _REVIEW_S if hand is None else 0.0
    robot = rig.robot
    room = partial(find_lack_of_room, folder)
    return Attendance(robot, placement, attended.operator, hand, review_s, robot.park, attended.park_after_s, room)


def find_lack_of_room(folder: Path, least_bytes: int = _LEAST_BYTES) -> str:
    """Return what is wrong where a disk has not the room for some more trials; empty where it has."""
    try:
        free_bytes = shutil.disk_usage(folder).free
    except OSError:  # the folder was moved or deleted, of which the log tells
        return ""
    if free_bytes >= least_bytes:
        return ""
    return f"the disk of {folder} has {free_bytes / 1e6:.1f} MB left: free some space, then continue by --resume"
