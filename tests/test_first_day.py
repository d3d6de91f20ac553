"""docs/first-day.md, command by command: each is understood, and on each device's mock its file learns."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main, make_parser
from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.drivers.registry import DRIVERS

TEXT = (Path(__file__).parent.parent / "docs" / "first-day.md").read_text()
COMMANDS = [line for block in re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL) for line in block.splitlines()]


def words_of(command: str) -> list[str]:
    program, *words = shlex.split(command)
    assert program == "vvvaltr"
    return words


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_is_understood(command: str) -> None:
    assert make_parser().parse_args(words_of(command)).execute


@pytest.mark.flaky(reruns=2)  # in real time
@pytest.mark.parametrize("device", ["qik", "odrive", "node", "struts"])
def test_the_file_that_init_writes_learns_on_its_device(
    device: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (init,) = [words_of(command) for command in COMMANDS if f"--driver {device}" in command]
    (learn,) = [words_of(command) for command in COMMANDS if "--trials" in command]
    with MockProcess(device, tmp_path / "port") as mock:
        assert main([*init, "--no-probe"]) == 0
        point_at_mock(Path("robot.toml"), Path(mock.greeting.robot_file))

        assert main([*learn, "--trials", "2", "--confirm", "1x1", "--duration", "0.5", "--no-recording"]) == 0

    assert [logged.trial.outcome.is_valid for logged in read_run(Path("runs/first")).trials].count(True) == 2


def point_at_mock(robot: Path, mock: Path) -> None:
    """Put the mock's port, tracker and hand into a file; all else stays as ``init`` has written it."""
    content, mocked = tomllib.loads(robot.read_text()), tomllib.loads(mock.read_text())
    line = content["line"][0]
    addresses = DRIVERS.named(line["driver"]).table.addresses
    line |= {key: value for key, value in mocked["line"][0].items() if key in addresses}
    robot.write_text(to_toml({**content, "tracker": mocked["tracker"], "hand": mocked["hand"]}))
