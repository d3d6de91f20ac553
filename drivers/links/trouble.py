"""What the operating system's error number means for a line: cause and cure in one line."""

from __future__ import annotations

import errno
import grp
import os
from contextlib import suppress

from vvvaltr.drivers.links.local import describe_buses, describe_ports, find_user

ECHO_CURE = "the receiving wire touches the sending one, or the adapter echoes; part the wires, or switch the echo off"
"""Of a line on which what is sent comes back."""


def explain(name: str, error: Exception) -> str:
    """Return why the line called ``name`` is lost or cannot be opened, with the cure.

    ``name`` is a serial port, or interface and channel of a CAN bus.
    """
    _, is_bus, channel = name.partition(":")
    port = channel.partition("@")[0] if is_bus else name
    match _find_number(error):
        case errno.ENOENT:
            return (
                f"{name}: there is no such port now{describe_ports()}; plug the device in, or write its new port into "
                "the robot's file, with which a run goes on by --resume DIR --robot FILE"
            )
        case errno.EACCES | errno.EPERM:
            return f"{name}: permission denied; {_permission_cure(port)}"
        case errno.EAGAIN | errno.EBUSY if os.path.exists(port):
            user = find_user(port)
            return f"{name}: in use by {user or 'another program'}; end that one first"
        case errno.ENOTTY | errno.EINVAL if os.path.exists(port):
            return f"{name} is not a serial port{describe_ports()}; correct its port"
        case errno.ENODEV if is_bus:
            return f"{name}: there is no such CAN interface{describe_buses()}; plug the adapter in, or correct channel"
        case errno.EAFNOSUPPORT if is_bus:
            return f"{name}: this kernel has no SocketCAN; load it by sudo modprobe can_raw, or use slcan"
        case errno.ENETDOWN:
            return (
                f"{name}: the CAN interface is down; sudo ip link set {channel} up type can bitrate 500000, with the "
                "bit rate of the drives"
            )
        case errno.ENOBUFS:
            return f"{name}: nobody on the bus takes the frames; check the drives' power, bit rate and termination"
        case errno.EIO | errno.ENXIO | errno.ENODEV | errno.ESHUTDOWN:
            return f"{name}: the device was unplugged or switched off; check its cable and power"
    return f"{name}: the line is lost or cannot be opened ({error}); check cable, port and power"


def _find_number(error: BaseException | None) -> int | None:
    """Return the error number of an error or of what it was caused by: the libraries wrap what the system says."""
    while error is not None:
        for number in (getattr(error, "errno", None), getattr(error, "error_code", None), *error.args[:1]):
            if isinstance(number, int) and number in errno.errorcode:
                return number
        error = error.__cause__ or error.__context__
    return None


def _permission_cure(port: str) -> str:
    group = "dialout"
    with suppress(OSError, KeyError):
        group = grp.getgrgid(os.stat(port).st_gid).gr_name
    if group == "root":
        return f"let your group use it by a udev rule, or, for now, type sudo chmod a+rw {port}"
    return f"join its group by sudo usermod -aG {group} $USER, then log out and in again"
