"""A first robot's file, with a comment on every line that its owner has to look at."""

from __future__ import annotations

from collections.abc import Sequence

from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.spelling import unknown

DRIVERS = ("qik", "odrive", "node", "struts")
TRACKERS = ("camera", "stream", "qtm", "natnet")
_COLUMN = 33

_HEAD = """\
# A robot for vvvaltr. Every key: docs/hardware.md
# Next: vvvaltr check FILE; vvvaltr calibrate FILE, where the motors have no sensors; vvvaltr learn --robot FILE
body = "icosahedron6"            # only for drawing: icosahedron6 (six struts), prism3 (three), or leave it out
"""

_LINES = {
    "qik": "baud = 19200                     # no slower than the number of motors needs: docs/hardware.md\n",
    "odrive": 'bitrate = 500000                 # as set in the drives\nfirmware = "0.6"                 # or "0.5"\n',
    "node": "baud = 460800\n",
    "struts": "allow_no_watchdog = false        # true: motors run on without radio; keep a hand at their switch\n",
}

_TRACKERS = {
    "camera": """\
[tracker]                        # a webcam above the floor: docs/camera.md
kind = "camera"
source = 0                       # number of the camera, or /dev/v4l/by-id/...

[tracker.tag]                    # printed by: vvvaltr camera FILE print-tag
size_m = 0.04                    # side of the black square: measure it
height_m = 0.06                  # of the tag above the floor: measure it to 1 mm
""",
    "stream": """\
[tracker]                        # JSON over UDP from any tracker: docs/trackers.md
kind = "stream"
port = 5005
""",
    "qtm": """\
[tracker]                        # Qualisys
kind = "qtm"
host = "192.168.0.10"            # the computer with QTM
body = "robot"                   # name of the rigid body there
""",
    "natnet": """\
[tracker]                        # OptiTrack
kind = "natnet"
host = "192.168.0.10"            # the computer with Motive
body = "robot"                   # name of the rigid body there
""",
}

_TAIL = """\
[search]                         # frequencies to search, in Hz; negative ones turn the other way
low_hz = 4.0
high_hz = {high_hz:g}

[arena]                          # where the robot may be, in the tracker's coordinates: a little less than it sees
x_m = [-0.4, 0.4]
y_m = [-0.25, 0.25]

[start]                          # where it is put back to before each trial
x_m = 0.0
y_m = 0.0
within_m = 0.03

[trial]
duration_s = 5.0
"""


def write_robot_file(
    driver: str,
    address: str,
    motors: int = 3,
    tracker: str = "camera",
    struts: Sequence[str] = (),
    max_hz: float = 16.0,
) -> str:
    """Return the text of a robot's file.

    Args:
        driver: one of ``DRIVERS``.
        address: the serial port; of an odrive also a CAN interface; of struts the Bluetooth adapter, empty for any.
        motors: their number.
        tracker: one of ``TRACKERS``.
        struts: names of the struts, one for each motor; empty for the usual ones.
        max_hz: greatest frequency of each motor.

    Raises:
        ValueError: there is no such driver or tracker.
    """
    if driver not in DRIVERS:
        raise ValueError(unknown("driver", driver, DRIVERS))
    if tracker not in TRACKERS:
        raise ValueError(unknown("tracker", tracker, TRACKERS))
    line = [f'[[line]]\ndriver = "{driver}"\n{_place(driver, address)}{_LINES[driver]}']
    line += [_motor(driver, number, max_hz, struts) for number in range(motors)]
    return "\n".join([_HEAD, *line, _TRACKERS[tracker], _TAIL.format(high_hz=max_hz)])


def _place(driver: str, address: str) -> str:
    if driver == "odrive":
        interface = "slcan" if address.startswith("/") else "socketcan"
        return _commented({"interface": interface, "channel": address}, "")
    if driver == "struts":
        return _commented({"adapter": address}, "hci0; empty for the first one")
    return _commented({"port": address}, "")


def _motor(driver: str, number: int, max_hz: float, struts: Sequence[str]) -> str:
    text = f"{'[[line.motor]]':{_COLUMN}}# motor {number + 1}\n"
    match driver:
        case "qik":
            text += _commented({"board": number // 2}, "device id of its board") + f"output = {number % 2}\n"
        case "odrive":
            text += _commented({"node": number}, "its CAN node")
        case "struts":
            name = struts[number] if number < len(struts) else f"VVVALTR{number + 1}"
            text += _commented({"strut": name}, "the name that it advertises, or its address")
    text += _commented({"max_hz": max_hz}, "more is refused; what its maker allows")
    if driver == "qik":
        text += _commented({"curve": [[14, 1.8], [127, max(max_hz, 16.5)]]}, "a guess: vvvaltr calibrate measures it")
    return text


def _commented(values: dict[str, object], comment: str) -> str:
    """Return keys and values as TOML, the last line with a comment."""
    lines = [line for key, value in values.items() for line in _inline(key, value)]
    return "".join(f"{line}\n" for line in lines[:-1]) + (
        f"{lines[-1]:{_COLUMN}}# {comment}\n" if comment else f"{lines[-1]}\n"
    )


def _inline(key: str, value: object) -> list[str]:
    return [" ".join(to_toml({key: value}).split()).replace(", ]", "]").replace("[ ", "[").replace(" ]", "]")]
