from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from typing import IO

import pytest
from hypothesis import HealthCheck, settings

from vvvaltr.drivers.mocking.process import MockProcess

_CANARY = """
import select, sys, time
last_s = time.monotonic()
while not select.select([sys.stdin], [], [], 0.005)[0]:
    now_s = time.monotonic()
    if now_s - last_s > 0.03:
        print(now_s, flush=True)
    last_s = now_s
"""


class Canary:
    """A process that does nothing but notice when the machine stands still, as virtual ones now and then do.

    Drivers and mock devices are tested in real time, in which a device that hears nothing for 0.25 s has to stop. What
    fails while the whole machine was held up is run again; what fails while it was not, or three times, is a failure.
    """

    def __init__(self) -> None:
        command = [sys.executable, "-c", _CANARY]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self._began_s = self._held_up_s = 0.0
        threading.Thread(target=self._read, args=[self._process.stdout], daemon=True).start()

    def _read(self, pauses: IO[str]) -> None:
        for line in pauses:
            self._held_up_s = float(line)

    def begin(self) -> None:
        """Begin a test."""
        self._began_s = time.monotonic()

    def was_held_up(self) -> bool:
        """Whether the machine stood still for 0.03 s or more since the test began."""
        time.sleep(0.05)  # what happened just now is being told
        return self._held_up_s > self._began_s

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


_canary = pytest.StashKey[Canary]()

_LONGEST = {
    "test_calibrate.py",
    "test_check.py",
    "test_entry.py",
    "test_first_day.py",
    "test_go_command.py",
    "test_mock_process.py",
    "test_pose_faults.py",
    "test_readme.py",
    "test_steering_safety.py",
}
"""Files that begin first, so that none is waited for in the end."""


# On a busy computer examples take long to draw; that is no defect of what is tested.
settings.register_profile("patient", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("patient")


def pytest_configure(config: pytest.Config) -> None:
    os.environ["XDG_STATE_HOME"] = tempfile.mkdtemp(prefix="vvvaltr-state-")  # of all processes: not the developer's
    config.stash[_canary] = Canary()
    config.add_cleanup(config.stash[_canary].close)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    # Tests that run side by side in several processes hold each other up, without the machine standing still.
    is_alone = not hasattr(config, "workerinput")
    condition = config.stash[_canary].was_held_up if is_alone else True
    for item in items:
        item.add_marker(pytest.mark.flaky(reruns=2, condition=condition))
    items.sort(key=lambda item: item.path.name not in _LONGEST)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.config.stash[_canary].begin()


@pytest.fixture(scope="module")
def qik(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("qik", tmp_path_factory.mktemp("qik") / "port") as mock:
        yield mock


@pytest.fixture(scope="module")
def spatial_qik(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess(
        "qik", tmp_path_factory.mktemp("spatial") / "port", "--robot", "spatial", "--pose-rate", "30"
    ) as mock:
        yield mock


@pytest.fixture(scope="module")
def odrive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("odrive", tmp_path_factory.mktemp("odrive") / "port") as mock:
        yield mock
