import errno
import os
from pathlib import Path

import pytest

from controller.disk import write_whole


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

    assert (tmp_path / "a.toml").read_text() == "old"
