"""What a tracker shows wrongly: the faults of poses, laid over the poses of a mock's twin."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.mocking.faults import Fault, Kind


class PoseFaults:
    """The faults of the moment. Their beginning and end come from a ``Schedule``."""

    def __init__(self) -> None:
        self._faults: list[Fault] = []
        self._held: Pose | None = None
        self._turn = 0

    def begin(self, fault: Fault) -> None:
        """Let a fault begin, of a kind in ``faults.POSE_KINDS``."""
        if not self._faults:
            self._held = None
        self._faults.append(fault)

    def end(self, fault: Fault) -> None:
        """End a fault."""
        self._faults.remove(fault)

    def shown(self, pose: Pose) -> Pose | None:
        """Return what the tracker shows of the true ``pose``; None where it does not see the robot."""
        self._held = self._held if self._faults and self._held else pose
        self._turn += 1
        shown = pose
        for fault in self._faults:
            if fault.kind is Kind.BLIND:
                return None
            shown = self._changed(shown, fault)
        return shown

    def _changed(self, pose: Pose, fault: Fault) -> Pose:
        held = self._held or pose
        match fault.kind:
            case Kind.FREEZE:
                return replace(held, t_s=pose.t_s)
            case Kind.SECOND_BODY:
                return pose if self._turn % 2 else replace(_moved(held, fault.size_m), t_s=pose.t_s)
            case _:
                return _CHANGES[fault.kind](pose, fault)


def _moved(pose: Pose, by_m: float) -> Pose:
    return _placed(pose, lambda at_m: (at_m[0] + by_m, at_m[1], at_m[2]))


def _scaled(pose: Pose, factor: float) -> Pose:
    return _placed(pose, lambda at_m: (factor * at_m[0], factor * at_m[1], factor * at_m[2]))


def _placed(pose: Pose, place: Callable[[Vector], Vector]) -> Pose:
    return replace(pose, position_m=place(pose.position_m), markers_m=tuple(map(place, pose.markers_m)))


_CHANGES: Mapping[Kind, Callable[[Pose, Fault], Pose]] = MappingProxyType(
    {
        Kind.JUMP: lambda pose, fault: _moved(pose, fault.size_m),
        Kind.ORIGIN: lambda pose, _: Pose(pose.t_s, (0.0, 0.0, 0.0)),
        Kind.UNIT: lambda pose, _: _scaled(pose, 1000.0),
        Kind.CLOCK_STEP: lambda pose, fault: replace(pose, t_s=pose.t_s + fault.step_s),
    }
)
