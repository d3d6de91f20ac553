"""The contract of all robots: twins, and each driver on its device in a process of its own."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from vvvaltr.controller.core.protocols import Robot
from vvvaltr.controller.loop.safety import GuardedRobot, Limits
from vvvaltr.controller.robot.contract import RobotContract
from vvvaltr.twin.presets import TWINS
from vvvaltr.twin.scatter import Scatter, TrackerNoise


class TwinContract(RobotContract):
    @pytest.fixture(scope="class")
    @classmethod
    def source(cls) -> Iterator[str]:
        yield cls.device

    def open_robot(self, source: str) -> Robot:
        twin = TWINS[source].make(scatter=Scatter.none(), noise=TrackerNoise.none())
        return GuardedRobot(twin, Limits(twin.max_hz))


class TestPlanarTwin(TwinContract):
    device = "planar"


class TestSpatialTwin(TwinContract):
    device = "spatial"


class TestQik(RobotContract):
    device = "qik"


class TestOdrive(RobotContract):
    device = "odrive"


class TestNode(RobotContract):
    device = "node"


class TestStruts(RobotContract):
    device = "struts"
