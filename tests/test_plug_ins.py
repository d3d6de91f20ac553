"""A package of its own adds a driver, a tracker and a method: installed, named, and broken in every way."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.plug_ins import Registry
from vvvaltr.drivers.registry import DRIVERS
from vvvaltr.drivers.trackers.registry import TRACKERS
from vvvaltr.transfer.methods.registry import REGISTRY

SAMPLE = Path(__file__).with_name("plugin_sample")
ROBOT = """
[[line]]
driver = "sample"
port = "bench"
motor = [{max_hz = 16.0}, {max_hz = 16.0}, {max_hz = 16.0}]

[tracker]
kind = "sample"
speed_m_s = 0.04

[trial]
duration_s = 0.3
"""
CONTRACT = """
import pytest
from vvvaltr.controller.robot.contract import RobotContract
from vvvaltr.controller.robot.opening import choose_robot, open_rig

class TestSample(RobotContract):
    @pytest.fixture
    def source(self):
        return "sample.toml"

    def open_robot(self, source):
        return open_rig(choose_robot({"name": source}), seed=0).robot
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    site, source = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("source")
    for file in SAMPLE.iterdir():
        if file.is_file():
            (source / file.name).write_bytes(file.read_bytes())
    options = ["--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", *options, "--target", str(site), str(source)]
    subprocess.run(command, check=True, timeout=100)
    return site


def vvvaltr(site: Path, here: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-m", "vvvaltr", *arguments]
    return subprocess.run(command, cwd=here, env=environment, capture_output=True, text=True, timeout=100)


def test_a_run_learns_with_the_driver_the_tracker_and_the_method_of_a_package(site: Path, tmp_path: Path) -> None:
    (tmp_path / "sample.toml").write_text(ROBOT, encoding="utf-8")

    arguments = ("--robot", "sample.toml", "--method", "sample", "--trials", "3", "--out", "run", "--no-recording")
    done = vvvaltr(site, tmp_path, "learn", *arguments, "--json")

    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout.splitlines()[-1])
    assert answer["method"] == "sample"
    assert answer["outcomes"] == {"completed": 3}
    assert answer["best_observed"]["score_m_s"] > 0.03  # the belt also moves while the motors rest


def test_the_contract_of_all_robots_runs_in_the_packages_own_tests(site: Path, tmp_path: Path) -> None:
    (tmp_path / "sample.toml").write_text(ROBOT, encoding="utf-8")
    (tmp_path / "test_sample.py").write_text(CONTRACT, encoding="utf-8")

    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_sample.py"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100)

    assert done.returncode == 0, done.stdout
    assert "12 passed" in done.stdout


def test_what_no_package_adds_is_refused_with_what_there_is(site: Path, tmp_path: Path) -> None:
    (tmp_path / "odd.toml").write_text(ROBOT.replace('"sample"', '"simple"', 1), encoding="utf-8")

    done = vvvaltr(site, tmp_path, "check", "--robot", "odd.toml")

    assert done.returncode != 0
    assert "line[1].driver is 'simple' (did you mean sample?); allowed: 'qik', 'odrive', 'node'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_sample_is_short() -> None:
    assert sum(len(file.read_text().splitlines()) for file in SAMPLE.iterdir() if file.is_file()) < 120


def broken(path: Path, monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    """Install a package ``vvvaltr-odd`` whose driver ``odd`` is at ``target``."""
    (path / "odd_driver.py").write_text("import nothing_like_it\n")
    (path / "odd_syntax.py").write_text("def\n")
    (path / "odd_type.py").write_text("DRIVER = 'qik'\n")
    metadata = path / "vvvaltr_odd-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: vvvaltr-odd\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[vvvaltr.drivers]\nodd = {target}\n")
    monkeypatch.syspath_prepend(path)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("odd_driver:DRIVER", "cannot be loaded (ModuleNotFoundError: No module named 'nothing_like_it')"),
        ("odd_syntax:DRIVER", "cannot be loaded (SyntaxError"),
        ("odd_type:ROW", "cannot be loaded (AttributeError"),
        ("odd_type:DRIVER", ": odd_type:DRIVER is a str instead of a Driver"),
    ],
)
def test_a_broken_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: str, reason: str) -> None:
    broken(tmp_path, monkeypatch, target)

    with pytest.raises(UserError) as caught:
        DRIVERS.named("odd")

    message = str(caught.value)
    assert message.startswith("driver 'odd' of the package vvvaltr-odd") and "\n" not in message
    assert reason in message
    assert message.endswith("mend or uninstall the package")


def test_a_broken_package_harms_nobody_who_does_not_name_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken(tmp_path, monkeypatch, "odd_driver:DRIVER")

    assert "odd" in DRIVERS.names
    assert DRIVERS.named("qik").table.__name__ == "QikLineTable"
    assert "odd_driver" not in sys.modules


@pytest.mark.parametrize("registry", [DRIVERS, TRACKERS, REGISTRY], ids=lambda registry: registry.noun)
def test_every_built_in_row_loads_and_an_unknown_one_is_answered_with_the_names(registry: Registry[object]) -> None:
    for name in registry.built_in:
        assert isinstance(registry.named(name), registry.kind)

    with pytest.raises(NotUnderstood, match=f"unknown {registry.noun} 'nonesuch'; choose one of"):
        registry.named("nonesuch")
