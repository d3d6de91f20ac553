"""Whose ports and addresses are opened when a run goes on: docs/decisions/0012-addresses-of-others.md says why."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from vvvaltr.controller.core.disk import read_bytes
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.robot.choice import RobotChoice

_KEY_BYTES = 32


def seal(robot: RobotChoice) -> str:
    """Return what proves later that this user, on this computer, opened the addresses of a robot's file.

    Empty for a twin, and where no key can be kept: such a run asks for the robot's file when it goes on.
    """
    key = b"" if robot.file is None else _key()
    return hmac.new(key, _canonical(robot.file), hashlib.sha256).hexdigest() if key else ""


def choose_resumed_robot(run: Path, robot: RobotChoice, sealed: str, named: str | None) -> RobotChoice:
    """Return the robot with which a run goes on, or which is driven again.

    Args:
        run: the run's folder.
        robot: what it was made with.
        sealed: what ``seal`` returned then.
        named: the robot's file that the user names now, None for none. Its addresses hold; all else must be as it was.

    Raises:
        UserError: the file differs in more than addresses, or none is named although the run came from elsewhere.
    """
    if robot.file is None:
        return robot
    if named is not None:
        return _with_new_addresses(run, robot, named)
    if not (sealed and hmac.compare_digest(sealed, seal(robot))):
        raise UserError(
            f"{run} was not made by you on this computer, so the ports and addresses in its run.toml are not opened: "
            "name your robot's file, --robot FILE.toml"
        )
    return robot


def _with_new_addresses(run: Path, robot: RobotChoice, named: str) -> RobotChoice:
    from vvvaltr.controller.robot.robot_file import load_robot_file, robot_file_from

    now = load_robot_file(Path(named))
    before = robot_file_from(robot.file, f"{run}/run.toml")
    difference = _difference(_without_addresses(before), _without_addresses(now))
    if difference:
        raise UserError(
            f"{named}: {difference} is not as in the run {run}, which can go on with other addresses only: restore it, "
            "or start a new run (--out)"
        )
    return RobotChoice(name=named, file=msgspec.to_builtins(now))


def _without_addresses(robot: Any) -> dict[str, Any]:
    content: dict[str, Any] = msgspec.to_builtins(robot)
    content.pop("hand", None)
    for table, plain in zip((*robot.line, robot.tracker), (*content["line"], content["tracker"]), strict=True):
        for key in table.addresses:
            plain.pop(key, None)
    return content


def _difference(before: Any, now: Any, place: str = "") -> str:
    """Return where two files differ first, as people write it; empty where they do not."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in (*before, *(key for key in now if key not in before)):
            if found := _difference(before.get(key), now.get(key), f"{place}.{key}".lstrip(".")):
                return found
        return ""
    if isinstance(before, list | tuple) and isinstance(now, list | tuple) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True), start=1)
        return next((found for n, pair in pairs if (found := _difference(*pair, f"{place}[{n}]"))), "")
    return "" if before == now else place


def _key() -> bytes:
    """Return this user's key on this computer, made on first use; empty where it cannot be kept."""
    state = os.environ.get("XDG_STATE_HOME") or "~/.local/state"
    path = Path(state).expanduser() / "vvvaltr" / "key"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        except FileExistsError:
            key = read_bytes(path, _KEY_BYTES)
        else:
            key = secrets.token_bytes(_KEY_BYTES)
            with os.fdopen(handle, "wb") as file:
                file.write(key)
    except (OSError, RuntimeError):  # a full or read-only disk; no home
        return b""
    return key if len(key) == _KEY_BYTES else b""


def _canonical(content: Mapping[str, Any] | None) -> bytes:
    return json.dumps(_without_none(content), sort_keys=True).encode()


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list | tuple) else value
