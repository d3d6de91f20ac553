"""Robots' files for mock devices, changed for a test."""

from pathlib import Path

from vvvaltr.drivers.mocking.process import MockProcess


def changed(mock: MockProcess, tmp_path: Path, old: str, new: str) -> str:
    """Return the name of a mock's robot file in which a text is replaced."""
    text = Path(mock.greeting.robot_file).read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "robot.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return str(path)
