"""Files from others: hostile ones cost neither time nor memory, and are told in one line."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("deep array.toml", "a = " + "[" * 100_000),
        ("deep table.toml", "a = " + "{a=" * 100_000),
        ("long key.toml", ".".join("a" * 300_000) + " = 1"),
        ("quoted key.toml", ".".join(['"a"'] * 100_000) + " = 1"),
        ("long table.toml", "[" + ".".join("a" * 300_000) + "]"),
        ("one word.toml", "a" * 1_000_000),
        ("dots.toml", "." * 1_000_000),
        ("many keys.toml", "".join(f"k{number} = 1\n" for number in range(1_000_000))),
        ("some keys.toml", "".join(f"k{number} = 1\n" for number in range(70_000))),
        ("many tables.toml", "".join(f"[t{number}]\n" for number in range(90_000))),
        ("many lines.toml", "[[line]]\n" * 110_000),
        ("spaces.toml", "a" + " " * 1_000_000),
        ("deep.json", "[" * 500_000),
        ("deep object.json", '{"line":' * 100_000),
        ("number.json", "1" * 1_000_000),
        ("control.toml", "a = 1\x00\x1b[2J"),
        ("latin.toml", "a = '\udce9'"),
        ("zero.toml", '[tracker]\nkind = "stream"\nhost = "a\\u0000b"'),
        ("zero.json", '{"tracker": {"host": "a\\u0000b"}}'),
    ],
    ids=lambda value: value if len(value) < 30 else "",
)
def test_a_hostile_file_is_one_line_and_no_wait(
    tmp_path: Path, name: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    path.write_bytes(text.encode("utf-8", "surrogateescape"))

    begin_s = time.perf_counter()
    status = main(["check", str(path)])

    assert time.perf_counter() - begin_s < 6.0
    told = capsys.readouterr().err
    assert status in (1, 2)
    assert len(told.splitlines()) == 1
    assert len(told) < 2000
    assert "defect" not in told
    assert name in told


@pytest.mark.parametrize("text", ["a = 'é'".encode("latin-1"), "a = 1".encode("utf-16")])
def test_a_file_in_another_encoding_is_refused_with_the_cure(
    tmp_path: Path, text: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "robot.toml").write_bytes(text)

    assert main(["check", str(tmp_path / "robot.toml")]) == 2
    assert "it is not UTF-8; save it as plain text in UTF-8" in capsys.readouterr().err
