"""What no run writes: numbers and counts that are right by checksum and absurd all the same.

A log may come from anybody. What is refused here would otherwise cost hours or all memory in some room above.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sized

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from vvvaltr.controller.core.conditions import check_speed
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb

MOST_BYTES = 64 << 20
"""Of one message: a picture, the ground, or a source of a million trials."""

MOST_LOG_BYTES = 8 << 30
"""Of a log: a thousand hours at 25 poses a second."""

_GREATEST = {"_m_s": 1e3, "_m": 1e5, "_hz": 1e5, "_rad": 1e6, "_s": 1e12}  # by the unit in a field's name
_GREATEST_NUMBER = 1e15
_LONGEST_S, _FARTHEST_M = 1e5, 1e5
_MOST = {"gaits": 1_000_000, "scores_m_s": 1_000_000, "height_m": 1_000_000}
_MOST_ENTRIES, _MOST_MOTORS, _MOST_LETTERS = 10_000, 64, 100_000


def check_message(message: Message) -> None:
    """Raise ValueError, naming the field, if a message holds what no run writes."""
    for field, value in message.ListFields():
        if field.message_type and field.message_type.GetOptions().map_entry:
            _check_map(field.name, value)
        elif field.is_repeated:
            check_count(field.name, value, _MOST.get(field.name, _MOST_ENTRIES))
            _check_values(field, value)
        else:
            _check_values(field, (value,))
    match message:
        case pb.Gait():
            check_count("gait.frequency_hz", message.frequency_hz, _MOST_MOTORS)
        case pb.Structure():
            _check_structure(message)
        case pb.Source():
            for number, score_m_s in enumerate(message.scores_m_s, start=1):
                check_speed(score_m_s, f"source {message.name}, trial {number}")
        case pb.Trial() if message.HasField("score_m_s"):
            check_speed(message.score_m_s, f"trial {message.number}")


def check_size(topic: str, payload: bytes) -> None:
    """Raise ValueError for a message that is too large to be read."""
    if len(payload) > MOST_BYTES:
        raise ValueError(f"a message on {topic} has {len(payload)} bytes; allowed: up to {MOST_BYTES}")


def check_record(message: pb.Tracking | pb.Command | pb.MotorState) -> None:
    """Do what ``check_message`` does, quickly: most of a log are these, and a pose may be no number."""
    if not abs(message.t_s) <= _LONGEST_S:
        raise ValueError(f"t_s is {message.t_s:g}; allowed: up to {_LONGEST_S:g}")
    match message:
        case pb.Tracking():
            if _FARTHEST_M < max(map(abs, (message.x_m, message.y_m, message.z_m))) < math.inf:
                raise ValueError(f"a pose is farther away than {_FARTHEST_M:g} m")
            check_count("markers_m", message.markers_m)
            if message.HasField("forces"):
                check_message(message.forces)
        case pb.Command():
            if not _is_usual(message):
                check_message(message)
        case pb.MotorState():
            for values in (message.frequency_hz, message.current_a, message.temperature_c):
                check_count("motor state", values, _MOST_MOTORS)


def _is_usual(command: pb.Command) -> bool:
    """Return whether a command sets frequencies alone, as nearly all do, and ones that a run could have written."""
    gait = command.gait
    is_plain = not gait.phase_rad and not gait.amplitude and len(gait.frequency_hz) <= _MOST_MOTORS
    return is_plain and all(abs(hz) <= _GREATEST["_hz"] for hz in gait.frequency_hz) and abs(command.hold_s) <= 1e12


def check_count(name: str, values: Sized, most: int = _MOST_ENTRIES) -> None:
    """Raise ValueError for too many values."""
    if len(values) > most:
        raise ValueError(f"{name} has {len(values)} values; allowed: up to {most}")


def _check_values(field: FieldDescriptor, values: Iterable[object]) -> None:
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_MESSAGE:
            for value in values:
                check_message(value)  # type: ignore[arg-type]
        case FieldDescriptor.CPPTYPE_STRING:
            for value in values:
                _check_text(field.name, value)
        case FieldDescriptor.CPPTYPE_DOUBLE:
            _check_numbers(field.name, values)  # type: ignore[arg-type]


def _check_map(name: str, content: Mapping[str, object]) -> None:
    check_count(name, content)
    for key, value in content.items():
        _check_text(name, key)
        if isinstance(value, float):
            _check_numbers(key, (value,))
        else:
            _check_text(key, value)


def _check_text(name: str, text: object) -> None:
    if isinstance(text, str) and len(text) > _MOST_LETTERS:
        raise ValueError(f"{name} has {len(text)} letters; allowed: up to {_MOST_LETTERS}")


def _check_numbers(name: str, numbers: Iterable[float]) -> None:
    greatest = next((most for unit, most in _GREATEST.items() if name.endswith(unit)), _GREATEST_NUMBER)
    for number in numbers:
        if not abs(number) <= greatest:  # false also for NaN
            raise ValueError(f"{name} is {number:g}; allowed: finite numbers up to {greatest:g}")


def _check_structure(message: pb.Structure) -> None:
    ends = 2 * len(message.struts)
    edges = (*message.struts, *message.springs)
    if any(end >= ends for edge in edges for end in (edge.first, edge.second)):
        raise ValueError("structure: an edge ends at a strut end that does not exist")
    if any(strut >= len(message.struts) for strut in message.motor_struts):
        raise ValueError("structure: a motor is on a strut that does not exist")
    check_count("motor_struts", message.motor_struts, _MOST_MOTORS)
