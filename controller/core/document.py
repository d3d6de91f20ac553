"""Files that people write: TOML or JSON into typed values, with errors that name the key, the value and the cure."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import tomli_w
from msgspec import inspect

from vvvaltr.controller.core.disk import read_text
from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import did_you_mean

_T = TypeVar("_T")
_MOST_BYTES = 1 << 20
_MOST_TABLES = 5000
_TOO_DEEP = "it is nested too deep"
_ZERO = re.compile(r"\\u0000|\\U00000000")
_LONG_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){20}""")


def load_document(path: Path, kind: type[_T]) -> _T:
    """Return the file at ``path`` as a ``kind``. Raises UserError; NotUnderstood for its contents."""
    return typed(read_document(path), kind, str(path))


def read_document(path: Path) -> Any:
    """Return the plain content of ``path``, JSON if its name says so, else TOML. Raises UserError, NotUnderstood."""
    try:
        text = read_text(path, _MOST_BYTES)
        _refuse_zeros(text)
        return json.loads(text) if path.suffix == ".json" else parse_toml(text)
    except FileNotFoundError:
        raise UserError(f"{path}: there is no such file") from None
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; name an ordinary file") from None
    except UnicodeDecodeError:
        raise NotUnderstood(f"{path} cannot be read: it is not UTF-8; save it as plain text in UTF-8") from None
    except ValueError as error:  # of TOML and JSON alike
        raise NotUnderstood(f"{path} cannot be read: {error}; mend that line") from None
    except RecursionError:
        raise NotUnderstood(f"{path} cannot be read: {_TOO_DEEP}; write it plainly") from None


def _refuse_zeros(text: str) -> None:
    """Raise ValueError for a zero character, which ends a name for the system and not for Python."""
    if _ZERO.search(text):
        raise ValueError("it has a zero character, \\u0000, which no name can have")


def parse_toml(text: str) -> dict[str, Any]:
    """Return TOML as plain content.

    Raises:
        ValueError: it is no TOML, or is nested deeper than any file of ours, which would take the parser hours.
    """
    if _LONG_KEY.search(text):
        raise ValueError(_TOO_DEEP)
    _refuse_zeros(text)
    if text.count("\n[") > _MOST_TABLES:
        raise ValueError(f"it has more than {_MOST_TABLES} tables")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None


def typed(content: Any, kind: type[_T], name: str) -> _T:
    """Return plain ``content``, read from ``name``, as a ``kind``. Raises NotUnderstood."""
    try:
        return msgspec.convert(content, kind)
    except RecursionError:
        raise NotUnderstood(f"{name}: {_TOO_DEEP}; write it plainly") from None
    except msgspec.ValidationError as error:
        raise NotUnderstood(f"{name}: {_explained(str(error), content, kind)}") from None


def to_toml(content: Mapping[str, Any], within: str = "") -> str:
    """Return plain ``content`` as TOML, each array on one line and each table under its header; None is left out."""
    tables = {key: value for key, value in content.items() if _is_table(value)}
    text = tomli_w.dumps({key: value for key, value in content.items() if value is not None and key not in tables})
    text = re.sub(r"^\w+ = \[\n.*?^\]", _on_one_line, text, flags=re.DOTALL | re.MULTILINE)
    for key, value in tables.items():
        for table in [value] if isinstance(value, dict) else value:
            header = f"[{within}{key}]" if isinstance(value, dict) else f"[[{within}{key}]]"
            text += f"\n{header}\n{to_toml(table, f'{within}{key}.')}"
    return text


def _is_table(value: Any) -> bool:
    is_list = isinstance(value, list | tuple) and len(value) > 0
    return isinstance(value, dict) or (is_list and all(isinstance(item, dict) for item in value))


def _on_one_line(array: re.Match[str]) -> str:
    return re.sub(r",\]", "]", re.sub(r"\s+", "", array[0]).replace("=", " = ", 1)).replace(",", ", ")


def _explained(message: str, content: Any, kind: type[Any]) -> str:
    """Return msgspec's message with the key first, then its value, then what is allowed."""
    complaint, _, path = message.partition(" - at `$")
    steps = re.findall(r"\w+", path)
    value = content
    node: inspect.Type | None = inspect.type_info(kind)
    for step in steps:
        node = _below(node, step, value)
        value = value[int(step)] if isinstance(value, list) else value.get(step, value)
    key = _named(steps)
    if unknown := re.search(r"unknown field `(\w+)`", complaint):
        fields = _fields(node, value)
        guess = did_you_mean(unknown[1], fields)
        return f"{_within(key)}{unknown[1]} is not a known key{guess}; allowed: {', '.join(fields)}"
    if missing := re.search(r"missing required field `(\w+)`", complaint):
        return f"{_within(key)}{missing[1]} is missing"
    if choices := _choices(node):
        guess = did_you_mean(str(value), [choice.strip("'") for choice in choices])
        return f"{key} is {value!r}{guess}; allowed: {', '.join(choices)}"
    shown = "" if isinstance(value, dict | list) else f" is {value!r}"
    return f"{key}{shown}: {complaint[:1].lower()}{complaint[1:]}".lstrip(": ")


def _named(steps: list[str]) -> str:
    """Return a path as people count: ``line[1].motor[2].max_hz``."""
    return "".join(f"[{int(step) + 1}]" if step.isdigit() else f".{step}" for step in steps).lstrip(".")


def _within(key: str) -> str:
    return f"{key}." if key else ""


def _below(node: inspect.Type | None, step: str, value: Any) -> inspect.Type | None:
    """Return the type at ``step`` of a value of type ``node``; None where it cannot be told."""
    if step.isdigit():
        match node:
            case inspect.VarTupleType() | inspect.ListType():
                return node.item_type
            case inspect.TupleType():
                return node.item_types[int(step)]
        return None
    struct = _struct(node, value)
    if struct is None:
        return None
    if step == struct.tag_field:
        return inspect.LiteralType(values=_tags(node))
    return next((field.type for field in struct.fields if field.encode_name == step), None)


def _struct(node: inspect.Type | None, value: Any) -> inspect.StructType | None:
    """Return the struct that ``node`` is, of several the one whose tag ``value`` has, else the first."""
    structs = _structs(node)
    tagged = [s for s in structs if isinstance(value, dict) and s.tag == value.get(s.tag_field or "")]
    return next(iter(tagged or structs), None)


def _structs(node: inspect.Type | None) -> list[inspect.StructType]:
    kinds = node.types if isinstance(node, inspect.UnionType) else (node,)
    return [kind for kind in kinds if isinstance(kind, inspect.StructType)]


def _tags(node: inspect.Type | None) -> tuple[str, ...]:
    return tuple(str(struct.tag) for struct in _structs(node))


def _fields(node: inspect.Type | None, value: Any) -> list[str]:
    struct = _struct(node, value)
    if struct is None:
        return []
    return [*([struct.tag_field] if struct.tag_field else []), *(field.encode_name for field in struct.fields)]


def _choices(node: inspect.Type | None) -> list[str]:
    match node:
        case inspect.LiteralType():
            return [repr(value) for value in node.values]
        case inspect.EnumType():
            return [repr(member.value) for member in node.cls]
    return []
