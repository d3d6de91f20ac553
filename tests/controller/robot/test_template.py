"""The ready robot files of examples/robots are what `init` writes, and open the devices that they are for."""

import tomllib
from pathlib import Path

import pytest

from vvvaltr.controller.robot.hardware import open_hardware
from vvvaltr.controller.robot.robot_file import load_robot_file, robot_file_from
from vvvaltr.controller.robot.template import DRIVERS, TRACKERS, write_robot_file
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.registry import DRIVERS as REGISTERED
from vvvaltr.drivers.trackers.registry import TRACKERS as REGISTERED_TRACKERS

ROBOTS = Path(__file__).parents[3] / "examples" / "robots"
WRITTEN = {"qik-pair": "qik", "odrive": "odrive", "node": "node"}
FIRMWARE = {"struts-laboratory": "laboratory", "struts-rfduino": "rfduino"}


def test_every_driver_and_tracker_has_a_template_and_every_driver_a_ready_file() -> None:
    assert set(DRIVERS) == set(REGISTERED.built_in)
    assert set(TRACKERS) == set(REGISTERED_TRACKERS.built_in)
    assert {load_robot_file(path).line[0].__struct_config__.tag for path in ROBOTS.glob("*.toml")} == set(DRIVERS)


@pytest.mark.parametrize("tracker", TRACKERS)
@pytest.mark.parametrize("driver", DRIVERS)
@pytest.mark.parametrize("motors", [1, 3, 5])
def test_what_init_writes_is_understood(driver: str, tracker: str, motors: int) -> None:
    robot = robot_file_from(tomllib.loads(write_robot_file(driver, "/dev/x", motors, tracker)), "robot.toml")

    assert len(robot.motors) == motors
    assert robot.tracker.__struct_config__.tag == tracker
    assert robot.start_place is not None
    assert robot.trial_settings.arena is not None


@pytest.mark.parametrize("name", WRITTEN)
def test_a_ready_file_is_what_init_writes(name: str) -> None:
    path = ROBOTS / f"{name}.toml"
    table = tomllib.loads(path.read_text())["line"][0]

    address = table.get("port", table.get("channel", table.get("adapter")))

    assert path.read_text() == write_robot_file(WRITTEN[name], address)


@pytest.mark.parametrize("name", sorted(path.stem for path in ROBOTS.glob("*.toml")))
def test_a_ready_file_opens_its_device(name: str, tmp_path: Path) -> None:
    firmware = ["--firmware", FIRMWARE[name]] if name in FIRMWARE else []
    with MockProcess(WRITTEN.get(name, "struts"), tmp_path / "port", *firmware) as mock:
        mocked = tomllib.loads(Path(mock.greeting.robot_file).read_text())
        content = tomllib.loads((ROBOTS / f"{name}.toml").read_text()) | {"tracker": mocked["tracker"]}
        addresses = REGISTERED.named(content["line"][0]["driver"]).table.addresses
        content["line"][0] |= {key: value for key, value in mocked["line"][0].items() if key in addresses}
        robot = robot_file_from(content, name)

        hardware = open_hardware(robot)

        assert hardware.motors.motor_count == 3
        hardware.close()
