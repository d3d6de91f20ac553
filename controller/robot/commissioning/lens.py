"""Keeps a calibrated lens in a robot's file."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

from vvvaltr.controller.core.disk import read_text, write_whole
from vvvaltr.controller.core.document import to_toml
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.robot_file import robot_file_from


def save_lens(path: Path, lens: dict[str, Any]) -> None:
    """Write ``[tracker.lens]`` into a robot's file in one step; comments and order of the rest stay.

    Args:
        path: the file, TOML or JSON.
        lens: the table, as plain values.

    Raises:
        UserError: the file would not be a robot's file any more; nothing is written.
    """
    text = read_text(path)
    lens = json.loads(json.dumps(lens))  # lists for tuples, as files have them
    if path.suffix == ".json":
        content = json.loads(text)
        content["tracker"]["lens"] = lens
        text = json.dumps(content, indent=2) + "\n"
    else:
        content = tomllib.loads(text)
        content["tracker"]["lens"] = lens
        text = _with_lens(text, lens)
        if tomllib.loads(text) != content:  # a lens that was written in another way, as an inline table
            text = to_toml(content)
    try:
        robot_file_from(content, str(path))
    except UserError as error:
        raise UserError(f"nothing was saved, the lens does not fit the file: {error}") from None
    write_whole(path.resolve(), text)


def _with_lens(text: str, lens: dict[str, Any]) -> str:
    table = f"[tracker.lens]\n{to_toml(lens)}"
    blocks = re.split(r"(?m)^(?=[ \t]*\[+[\w. ]+\]+[ \t]*(?:#.*)?$)", text)
    for number, block in enumerate(blocks):
        if re.match(r"\s*\[\s*tracker\s*\.\s*lens\s*\]", block):
            blocks[number] = f"{table}\n"
            return "".join(blocks)
    return f"{text.rstrip()}\n\n{table}"
