"""Finds good gaits for vibration-driven tensegrity robots, and carries what it learned to the next condition.

The names below are the public ones; docs/python.md shows them at work. Each is imported when it is first used, so that
``import vvvaltr`` is instant.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:  # for type checkers and editors; _ROOMS says the same at run time, and a test compares the two
    from vvvaltr.controller.core.errors import (
        DeviceError,
        DeviceFault,
        DeviceTimeout,
        LinkLost,
        SafetyStop,
        TrackingLost,
        UserError,
    )
    from vvvaltr.controller.core.gaits import Gait, GaitSpace, Quantity
    from vvvaltr.controller.core.protocols import AskTell, Clock, MotorDriver, Observer, Optimizer, Robot, Tracker
    from vvvaltr.controller.core.records import LoggedTrial, Run
    from vvvaltr.controller.core.signals import interrupt_on_signals
    from vvvaltr.controller.core.values import (
        Estimate,
        MotorState,
        Outcome,
        Pose,
        Recommendation,
        Source,
        Suggestion,
        Trial,
    )
    from vvvaltr.controller.loop.safety import Arena, GuardedRobot, Limits
    from vvvaltr.controller.loop.trial_runner import TrialCrashed, TrialSettings, run_trial
    from vvvaltr.library import OpenRobot, learn, open_robot, read_run, read_source
    from vvvaltr.transfer.methods.registry import make_optimizer
    from vvvaltr.twin.presets import planar_robot, spatial_robot

_ROOMS = {
    "controller.core.errors": "DeviceError DeviceFault DeviceTimeout LinkLost SafetyStop TrackingLost UserError",
    "controller.core.gaits": "Gait GaitSpace Quantity",
    "controller.core.protocols": "AskTell Clock MotorDriver Observer Optimizer Robot Tracker",
    "controller.core.records": "LoggedTrial Run",
    "controller.core.signals": "interrupt_on_signals",
    "controller.core.values": "Estimate MotorState Outcome Pose Recommendation Source Suggestion Trial",
    "controller.loop.safety": "Arena GuardedRobot Limits",
    "controller.loop.trial_runner": "TrialCrashed TrialSettings run_trial",
    "library": "OpenRobot learn open_robot read_run read_source",
    "transfer.methods.registry": "make_optimizer",
    "twin.presets": "planar_robot spatial_robot",
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names.split()}

__all__ = [  # noqa: RUF022 - in the order of use
    "open_robot", "planar_robot", "spatial_robot", "OpenRobot",
    "Gait", "GaitSpace", "Quantity", "run_trial", "TrialSettings", "Trial", "Outcome", "Pose", "MotorState",
    "learn", "make_optimizer", "read_source", "Source", "read_run", "Run", "LoggedTrial",
    "Suggestion", "Estimate", "Recommendation",
    "GuardedRobot", "Limits", "Arena", "TrialCrashed", "interrupt_on_signals",
    "Robot", "MotorDriver", "Tracker", "Clock", "Optimizer", "AskTell", "Observer",
    "UserError", "DeviceError", "DeviceTimeout", "DeviceFault", "LinkLost", "TrackingLost", "SafetyStop",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'vvvaltr' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"vvvaltr.{_HOMES[name]}"), name)
    globals()[name] = value  # found at once from now on
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
