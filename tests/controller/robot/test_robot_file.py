from __future__ import annotations

import tomllib
from pathlib import Path

import msgspec
import pytest

from vvvaltr.controller.core.document import load_document, to_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.robot.commissioning.calibrate import (
    Reading,
    fit_curve,
    remove_curves,
    replace_curves,
    rewrite_robot_file,
)
from vvvaltr.controller.robot.robot_file import RobotFile, load_robot_file, robot_file_from
from vvvaltr.drivers.mocking.faults import FaultScript, Kind
from vvvaltr.drivers.node.table import NodeLineTable
from vvvaltr.drivers.odrive.table import OdriveLineTable
from vvvaltr.drivers.qik.protocol import watchdog_timeout_s
from vvvaltr.drivers.qik.table import QikLineTable
from vvvaltr.drivers.trackers.stream.table import StreamTable

GOOD = """\
# our robot
body = "prism3"

[[line]]
driver = "qik"
port = "/dev/ttyUSB0"   # the left socket

[[line.motor]]
board = 0
output = 0
max_hz = 16.0
curve = [[14, 2.0],
         [127, 16.0]]

[[line.motor]]   # the second
board = 1
output = 0
max_hz = 15.0
curve = [[14, 2.0], [127, 16.0]]

[[line]]
driver = "odrive"
interface = "slcan"
channel = "/dev/ttyACM0"
options = { sleep_after_open = 2.0 }

[[line.motor]]
node = 3
max_hz = 20.0

[tracker]
kind = "stream"
port = 5005

[search]
low_hz = 4.0
high_hz = 15.0

[arena]
x_m = [-0.5, 0.5]
y_m = [-1.0, 1.0]

[trial]
duration_s = 8.0
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "robot.toml"


def written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def refusal(path: Path, text: str) -> str:
    with pytest.raises(UserError) as caught:
        load_robot_file(written(path, text))
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message
    return message.removeprefix(f"{path}").lstrip(": ")


def test_a_file_says_limits_search_arena_and_trials(path: Path) -> None:
    robot = load_robot_file(written(path, GOOD))

    assert robot.limits.max_hz == (16.0, 15.0, 20.0)
    assert robot.range_hz == (4.0, 15.0)
    assert robot.trial_settings.duration_s == 8.0
    assert robot.trial_settings.arena == Arena((-0.5, 0.5), (-1.0, 1.0))
    assert [type(line) for line in robot.line] == [QikLineTable, OdriveLineTable]


def test_without_a_search_all_that_the_motors_can_do_is_searched(path: Path) -> None:
    text = GOOD[: GOOD.index("[search]")]

    assert load_robot_file(written(path, text)).range_hz == (-15.0, 15.0)


def test_a_run_keeps_the_file_and_gives_it_back(path: Path) -> None:
    robot = load_robot_file(written(path, GOOD))

    kept = tomllib.loads(to_toml(msgspec.to_builtins(robot)))

    assert robot_file_from(kept, "run.toml") == robot


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'driver = "qik"',
            'driver = "quick"',
            "line[1].driver is 'quick' (did you mean qik?); allowed: 'qik'",
        ),
        ("max_hz = 16.0", 'max_hz = "fast"', "line[1].motor[1].max_hz is 'fast': expected"),
        ("max_hz = 16.0", "max_hz = -1", "line[1].motor[1].max_hz is -1: expected"),
        ("max_hz = 16.0", "max_hz = 17.0", "line[1].motor[1].max_hz is 17; allowed: up to 16"),
        ("max_hz = 20.0", "max_hz = inf", "line[2].motor[1].max_hz is inf: expected"),
        ("max_hz = 16.0", "max_hz = 16.0\nramp_hz_s = inf", "line[1].motor[1].ramp_hz_s is inf: expected"),
        ("port = 5005", "port = 5005\nage_limit_s = inf", "tracker.age_limit_s is inf: expected"),
        ("output = 0", "output = 2", "line[1].motor[1].output is 2; allowed: 0, 1"),
        (
            "board = 1",
            "bord = 1",
            "line[1].motor[2].bord is not a known key (did you mean board?); allowed: max_hz",
        ),
        (
            "board = 1\noutput = 0",
            "board = 0\noutput = 0",
            "line[1].motor[2] is at board 0, output 0, where",
        ),
        ("board = 1\n", "", "line[1].motor[2].board is missing"),
        ("[127, 16.0]]\n\n[[line.motor]]", "[10, 16.0]]\n\n[[line.motor]]", "line[1].motor[1].curve: the points"),
        ('"   # the left', '"\ntimeout = 16\n#', "line[1].timeout is 16, which means 0 s; allowed: 1 (0.262 s), 2"),
        ('"   # the left', '"\ntimeout = 0\n#', "line[1].timeout is 0, which means 0 s; allowed: 1 (0.262 s), 2"),
        ('"   # the left', '"\ntimeout = 127\n#', "line[1].timeout is 127, which means 503.04 s; allowed: 1"),
        ('"   # the left', '"\ntimeout = 128\n#', "line[1].timeout is 128: expected"),
        ('"   # the left', '"\nbaud = 4800\n#', "line[1].baud is 4800; allowed: 7200 or more, which 2 motors"),
        ('"   # the left', '"\nbaud = 57600\n#', "line[1].baud is 57600: expected"),
        (
            "[[14, 2.0], [127, 16.0]]",
            "[[14, 2.0], [255, 16.0]]",
            "line[1].motor[2].curve: its commands reach 255; allowed: up to 127, or",
        ),
        ("port = 5005", "port = 70000", "tracker.port is 70000: expected"),
        ('kind = "stream"', 'kind = "radar"', "tracker.kind is 'radar'; allowed: 'stream'"),
        ("high_hz = 15.0", "high_hz = 16.0", "search.high_hz is 16; allowed: -15 to 15"),
        ("low_hz = 4.0", "low_hz = 15.0", "search.high_hz is 15; allowed: above search.low_hz"),
        ("x_m = [-0.5, 0.5]", "x_m = [0.5, -0.5]", "arena.x_m is [0.5, -0.5]; allowed: [low, high]"),
        ("duration_s = 8.0", "duration_s = 0", "trial.duration_s is 0: expected"),
        ("duration_s = 8.0", "hold_s = 0.01", "trial.hold_s is 0.01; allowed: above period_s"),
        (
            "[arena]",
            "[area]",
            "area is not a known key (did you mean arena?); allowed: line, tracker",
        ),
        ('body = "prism3"', 'body = "cube"', "body is 'cube'; allowed: '', 'icosahedron6', 'prism3'"),
        ("[tracker]", "[tracker", "cannot be read"),
    ],
)
def test_a_bad_file_is_refused_with_key_value_and_what_is_allowed(path: Path, old: str, new: str, message: str) -> None:
    assert old in GOOD

    assert refusal(path, GOOD.replace(old, new, 1)).startswith(message)


@pytest.mark.parametrize("timeout", [0, 1, 2, 3, 4, 15, 16, 17, 18, 32, 33, 112, 127])
def test_a_qik_line_has_a_watchdog_of_a_second_at_most_or_is_refused(path: Path, timeout: int) -> None:
    written(path, GOOD.replace('"   # the left', f'"\ntimeout = {timeout}\n#'))

    if timeout in (1, 2, 3, 17):
        assert isinstance(line := load_robot_file(path).line[0], QikLineTable)
        assert 0.2 < watchdog_timeout_s(line.timeout) < 0.8
    else:
        with pytest.raises(UserError, match=rf"line\[1\]\.timeout is {timeout}, which means"):
            load_robot_file(path)


def test_with_eight_bits_commands_reach_255_and_no_further(path: Path) -> None:
    text = GOOD.replace('"   # the left', '"\neight_bit = true\n#')

    fine = load_robot_file(written(path, text.replace("[127, 16.0]", "[255, 16.0]")))

    assert fine.motors[0].curve[-1] == (255.0, 16.0)
    assert refusal(path, text.replace("[127, 16.0]", "[256, 16.0]", 1)) == (
        "line[1].motor[1].curve: its commands reach 256; allowed: up to 255"
    )


def test_a_file_without_motors_is_refused(path: Path) -> None:
    assert refusal(path, 'line = []\n[tracker]\nkind = "stream"\nport = 5\n').startswith("line.motor is empty")
    idle = '[[line]]\ndriver = "qik"\nport = "/dev/ttyUSB1"\nmotor = []\n\n'
    assert refusal(path, GOOD.replace("[tracker]", f"{idle}[tracker]")).startswith("line[3].motor is empty")


def test_a_file_that_is_not_there_is_named(path: Path) -> None:
    with pytest.raises(UserError, match=r"robot\.toml: there is no such file"):
        load_robot_file(path)


def test_fault_scripts_are_toml_or_json(tmp_path: Path) -> None:
    toml, json = tmp_path / "faults.toml", tmp_path / "faults.json"
    toml.write_text('[[fault]]\nkind = "drop"\nat_s = 1.0\nreplies = 3\n', encoding="utf-8")
    json.write_text('{"fault": [{"kind": "drop", "at_s": 1.0, "replies": 3}]}', encoding="utf-8")

    assert load_document(toml, FaultScript) == load_document(json, FaultScript)
    assert load_document(toml, FaultScript).fault[0].kind is Kind.DROP


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('kind = "melt"\nat_s = 1.0', "fault[1].kind is 'melt'; allowed: 'drop', 'corrupt', 'delay'"),
        ('kind = "drop"', "fault[1]: a fault has one of at_s, after_motion_s and at_reply"),
        ('kind = "drop"\nat_s = -1.0', "fault[1]: at_s is -1, but must be 0 or more, and finite"),
    ],
)
def test_a_bad_fault_script_is_refused_in_the_same_way(path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        load_document(written(path, f"[[fault]]\n{text}\n"), FaultScript)

    assert str(caught.value).startswith(f"{path}: {message}")


def calibrated(robot: RobotFile) -> RobotFile:
    return replace_curves(
        robot, [((14.0, 1.5), (127.0, 14.5)), ((14.0, 2.1), (127.0, 15.5)), ((2.0, 2.0), (20.0, 19.0))]
    )


def test_a_calibration_changes_curves_limits_and_search_and_leaves_the_rest_as_written(path: Path) -> None:
    robot = calibrated(load_robot_file(written(path, GOOD)))

    text = rewrite_robot_file(GOOD, robot)

    assert load_robot_file(written(path, text)) == robot
    assert robot.limits.max_hz == (14.5, 15.0, 19.0)
    assert robot.range_hz == (4.0, 14.5)
    assert "# our robot" in text and "# the left socket" in text and "# the second" in text
    assert len(text.splitlines()) == len(GOOD.splitlines())  # two lines of one curve became one, another has come


def test_a_file_of_another_layout_is_written_anew(path: Path) -> None:
    text = """
line = [{driver = "odrive", channel = "can0", motor = [{node = 0, max_hz = 20.0}]}]
tracker = {kind = "stream", port = 1}
"""
    robot = replace_curves(load_robot_file(written(path, text)), [((2.0, 2.0), (20.0, 19.0))])

    assert load_robot_file(written(path, rewrite_robot_file(text, robot))) == robot


def test_to_calibrate_commands_take_the_place_of_frequencies(path: Path) -> None:
    bare = remove_curves(load_robot_file(written(path, GOOD)))

    assert [motor.curve for motor in bare.motors] == [((1.0, 1.0), (127.0, 127.0))] * 2 + [()]
    assert bare.limits.max_hz == (127.0, 127.0, 20.0)


def test_to_calibrate_a_ramp_is_as_steep_in_commands_as_it_is_in_hz(path: Path) -> None:
    bare = remove_curves(load_robot_file(written(path, GOOD.replace("max_hz = ", "ramp_hz_s = 4.0\nmax_hz = "))))

    ramps = [motor.ramp_hz_s for motor in bare.motors]
    assert ramps == pytest.approx([4.0 * 127 / 16, 4.0 * 118.93 / 15, 4.0], rel=1e-4)


def test_a_curve_rises_and_what_was_not_seen_is_taken_from_the_former_one_in_proportion() -> None:
    seen = [Reading(0, c, hz) for c, hz in ((127.0, 16.0), (100.0, 12.0), (70.0, 12.5), (50.0, float("nan")))]

    assert fit_curve(seen, ()) == ((100.0, 12.0), (127.0, 16.0))
    assert fit_curve(seen, ((14.0, 2.0), (50.0, 6.0), (100.0, 10.0), (127.0, 14.0))) == (
        (14.0, 2.4),
        (50.0, 7.2),
        (100.0, 12.0),
        (127.0, 16.0),
    )


def test_a_motor_that_was_never_seen_to_turn_has_no_curve() -> None:
    with pytest.raises(UserError, match=r"motor 3 could be measured at fewer than two commands"):
        fit_curve([Reading(2, 127.0, float("nan")), Reading(2, 60.0, 8.0)], ())


VERSION_0_1 = Path(__file__).parents[2] / "fixtures" / "version_0_1" / "robots"


@pytest.mark.parametrize(
    ("device", "table"), [("qik", QikLineTable), ("odrive", OdriveLineTable), ("node", NodeLineTable)]
)
def test_a_file_of_version_0_1_opens_and_its_devices_are_written_as_they_were(device: str, table: type) -> None:
    path = VERSION_0_1 / f"{device}.toml"

    robot = load_robot_file(path)

    assert type(robot.line[0]) is table
    assert robot.limits.max_hz == (16.5, 16.5, 16.5)
    assert robot.tracker == StreamTable(port=5005)
    assert robot_file_from(msgspec.to_builtins(robot), "run.toml") == robot
    written, former = (
        tomllib.loads(to_toml(msgspec.to_builtins(robot))),
        tomllib.loads(path.read_text(encoding="utf-8")),
    )
    for key in ("line", "search", "body"):
        assert written[key] == former[key]
    assert written["tracker"].items() >= former["tracker"].items()  # new keys have joined it since


@pytest.mark.parametrize(
    ("key", "value"), [("x_m", "inf"), ("yaw_rad", "nan"), ("yaw_rad", "inf"), ("within_m", "inf")]
)
def test_a_start_that_no_robot_could_be_put_back_to_is_named_with_its_key(path: Path, key: str, value: str) -> None:
    without_arena = GOOD[: GOOD.index("[arena]")]
    assert refusal(path, f"{without_arena}[start]\n{key} = {value}\n").startswith(f"start.{key} is {value}")


@pytest.mark.parametrize("side", ["[-inf, inf]", "[0.0, inf]", "[-inf, 1.0]", "[nan, 1.0]", "[1.0, 1.0]"])
def test_an_arena_without_a_middle_is_refused(path: Path, side: str) -> None:
    message = refusal(path, GOOD.replace("[-0.5, 0.5]", side))
    assert message == f"arena.x_m is {side}; allowed: [low, high] with low < high, both finite"
