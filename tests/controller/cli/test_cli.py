"""The command line as its users rely on it: results on standard output, one line for bad input, exit statuses."""

import subprocess
import sys
from pathlib import Path

import pytest
from calling import call

from vvvaltr.controller.cli.main import COMMANDS


def test_help_shows_every_command_and_each_command_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = call(["--help"], capsys)
    assert all(command in out for command in COMMANDS)
    for command in COMMANDS:
        status, out, _ = call([command, "--help"], capsys)
        assert status == 0
        assert f"example: vvvaltr {command}" in " ".join(out.split())


NOT_UNDERSTOOD = [
    ("", "COMMAND is missing"),
    ("lern", "unknown command 'lern' (did you mean learn?)"),
    ("dance", "unknown command 'dance'; choose one of learn"),
    ("run 12 -14 9", "run is now called trial"),
    ("learn --trails 3", "unknown option --trails (did you mean --trials?)"),
    ("learn planar", "unexpected argument 'planar'"),
    ("learn --robot plannar", "unknown robot 'plannar' (did you mean planar?)"),
    ("learn --world hils", "unknown world 'hils' (did you mean hills?)"),
    ("learn --world hills:hight_m=3", "unknown setting of hills 'hight_m' (did you mean height_m?)"),
    ("learn --damage snap:99", "snap:99"),
    ("learn --body prism", "unknown body 'prism' (did you mean prism3?)"),
    ("learn --law excentric", "unknown value 'excentric' (did you mean eccentric?)"),
    ("learn --method plian", "unknown method 'plian' (did you mean plain?)"),
    ("learn --score pth", "unknown value 'pth' (did you mean path?)"),
    ("learn --method efficient", "source"),
    ("learn --trials -3", "argument --trials: '-3' is not a whole number of at least 1"),
    ("learn --trials 0", "0"),
    ("learn --seed -1", "-1"),
    ("learn --duration 0", "0"),
    ("learn --duration nan", "nan"),
    ("learn --optimise fase", "unknown value 'fase' (did you mean phase?)"),
    ("learn --optimise phase", "frequency"),
    ("learn --range 4 40", "40"),
    ("learn --range 9 4", "9"),
    ("learn --confirm 3", "3"),
    ("learn --confirm 4x10", "4x10"),
    ("learn --stop-when 0", "0"),
    ("learn --resume nowhere --out there", "not allowed with"),
    ("learn --quiet --verbose", "not allowed with"),
    ("trial", "F is missing; example: vvvaltr trial 12 -14 9"),
    ("trial 12 14", "2 frequencies"),
    ("trial 12 14 99", "99"),
    ("trial 12 14 nan", "nan"),
    ("trial 12 14 9 --repeats 0", "--repeats"),
    ("trial 12 14 9 --amplitude 2 1 1", "amplitude"),
    ("trial 12 14 9 --phase 1 2 --robot missing.toml", "--phase has 2 values for 3 motors"),  # before it is opened
    ("trial 12 14 9 --amplitude 1", "--amplitude has 1 value for 3 motors"),
    ("learn --or-resume", "give --out DIR as well"),
    ("check planar", "planar is a twin; check tests the links, motors, watchdogs and tracker of a real robot"),
    ("check a.toml --robot b.toml", "takes one robot"),
    ("calibrate", "name its file, as in vvvaltr calibrate robot.toml"),
    ("landscape --grid 1", "1"),
    ("landscape --out picture.bmp", "picture.bmp"),
    ("mock quik", "'quik' (did you mean qik?)"),
    ("import t.csv --giat RPM_1", "unknown option --giat (did you mean --gait?)"),
    ("import", "CSV, --gait, --unit, --score-unit, --out are missing; example: vvvaltr import"),
    ("completion fish", "choose one of bash, zsh, tcsh"),
]
FAILED = [
    ("learn --robot missing.toml", "missing.toml: there is no such file; vvvaltr init missing.toml writes a first one"),
    ("learn --source nowhere", "nowhere"),
    ("learn --resume nowhere", "nowhere"),
    ("check missing.toml", "missing.toml: there is no such file"),
    ("view nowhere", "nowhere"),
    ("init no/where.toml --driver qik --port /dev/null --no-probe", "no/where.toml cannot be written"),
    ("foxglove-layout no/where.json", "no is no directory; make it, or name another file"),
]


@pytest.mark.parametrize(
    ("arguments", "status", "complaint"),
    [*((*case[:1], 2, *case[1:]) for case in NOT_UNDERSTOOD), *((*case[:1], 1, *case[1:]) for case in FAILED)],
)
def test_bad_input_is_one_line_with_a_status_that_tells_what_it_is_and_nothing_is_written(
    arguments: str,
    status: int,
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)

    ended, out, err = call(arguments.split(), capsys)

    assert (ended, out) == (status, "")
    assert len(err.splitlines()) == 1 and complaint in err
    assert list(tmp_path.iterdir()) == []


def test_help_needs_no_numerical_library() -> None:
    code = "import sys; from vvvaltr.controller.cli.main import main\ntry: main(['--help'])\nexcept SystemExit: pass\n"
    heavy = ("numpy", "scipy", "pymunk", "mcap", "rerun", "mujoco", "can", "msgspec")
    code += f"assert not set({heavy!r}) & set(sys.modules), set({heavy!r}) & set(sys.modules)"

    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
