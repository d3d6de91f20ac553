from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vvvaltr.drivers.odrive.protocol
from vvvaltr.drivers.links.can import Frame
from vvvaltr.drivers.odrive.mock import OdriveDevice
from vvvaltr.drivers.odrive.protocol import Message, decode, encode

DBC: Any = cantools.database.load_file(Path(vvvaltr.drivers.odrive.protocol.__file__).with_name("odrive.dbc"))
FLOATS = st.floats(width=32, allow_nan=False, allow_infinity=False)
NAMES = {
    Message.HEARTBEAT: "Heartbeat",
    Message.ESTOP: "Estop",
    Message.SET_STATE: "SetState",
    Message.ENCODER_ESTIMATES: "EncoderEstimates",
    Message.SET_MODES: "SetModes",
    Message.SET_VELOCITY: "SetVelocity",
    Message.SET_LIMITS: "SetLimits",
    Message.CURRENT: "Current",
    Message.CLEAR_ERRORS: "ClearErrors",
}


def test_the_dbc_has_just_the_messages_that_are_used() -> None:
    assert {message.frame_id: message.name for message in DBC.messages} == {int(m): name for m, name in NAMES.items()}


@given(FLOATS, FLOATS, st.integers(0, 63))
@pytest.mark.parametrize("message", [Message.SET_VELOCITY, Message.SET_LIMITS])
def test_what_we_encode_is_what_the_dbc_says(message: Message, first: float, second: float, node: int) -> None:
    frame = encode(node, message, first, second)

    assert frame.identifier == (node << 5) + DBC.get_message_by_name(NAMES[message]).frame_id
    assert list(DBC.decode_message(int(message), frame.data).values()) == [first, second]


def test_states_modes_and_plain_commands_agree_with_the_dbc() -> None:
    assert DBC.decode_message(7, encode(0, Message.SET_STATE, 8).data) == {"RequestedState": 8}
    assert DBC.decode_message(11, encode(0, Message.SET_MODES, 2, 1).data) == {"ControlMode": 2, "InputMode": 1}
    assert DBC.decode_message(24, encode(0, Message.CLEAR_ERRORS, 0).data) == {"Identify": 0}
    assert encode(3, Message.ESTOP) == Frame(3 << 5 | 2, b"")


@given(FLOATS, FLOATS, st.integers(0, 63))
@pytest.mark.parametrize("message", [Message.ENCODER_ESTIMATES, Message.CURRENT])
def test_what_the_dbc_encodes_we_decode(message: Message, first: float, second: float, node: int) -> None:
    signals = DBC.get_message_by_name(NAMES[message]).signals
    data = DBC.encode_message(int(message), dict(zip((s.name for s in signals), (first, second), strict=True)))

    assert decode(Frame(node << 5 | message, data)) == (node, message, (first, second))


@given(st.integers(0, 2**32 - 1), st.integers(0, 255))
def test_heartbeats_are_decoded_as_the_dbc_says(error: int, state: int) -> None:
    data = DBC.encode_message(1, {"AxisError": error, "AxisState": state})

    assert decode(Frame(5 << 5 | 1, data)) == (5, Message.HEARTBEAT, (error, state))


def test_the_mocks_frames_agree_with_the_dbc() -> None:
    axis = OdriveDevice().axes[2]

    assert DBC.decode_message(1, axis.frame(Message.HEARTBEAT).data) == {"AxisError": 0, "AxisState": 1}
    assert DBC.decode_message(9, axis.frame(Message.ENCODER_ESTIMATES).data) == {"Position": 0.0, "Velocity": 0.0}


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_no_number_is_never_sent(value: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        encode(0, Message.SET_VELOCITY, value, 0.0)


@pytest.mark.parametrize(
    "frame",
    [
        Frame(9, b"\0" * 7),
        Frame(1, b""),
        Frame(9, b"\0" * 8, is_remote=True),
        Frame(0x1F, b"\0" * 8),
        Frame(0x02),
    ],
)
def test_frames_that_are_cut_off_or_foreign_are_not_taken_for_news(frame: Frame) -> None:
    assert decode(frame) is None
