import errno
import os
from pathlib import Path

import pytest

from vvvaltr.controller.core.disk import new_folder, write_whole


def test_a_file_is_written_whole_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.toml", "old")
    write_whole(tmp_path / "a.toml", "new")

    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.toml": "new"}


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_whole(tmp_path / "a.toml", "old")

    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_whole(tmp_path / "a.toml", "new")

    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.toml": "old"}


def test_a_folder_appears_whole(tmp_path: Path) -> None:
    with new_folder(tmp_path / "runs" / "a") as fresh:
        (fresh / "log").write_text("all of it")
        assert not (tmp_path / "runs" / "a").exists()

    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["a"]
    assert (tmp_path / "runs" / "a" / "log").read_text() == "all of it"


def test_what_fails_in_a_new_folder_leaves_nothing_and_takes_no_others_place(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "log").write_text("of another run")

    with pytest.raises(OSError, match="not empty"), new_folder(tmp_path / "a") as fresh:
        (fresh / "log").write_text("mine")
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "b"):
        raise KeyboardInterrupt

    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a" / "log").read_text() == "of another run"
