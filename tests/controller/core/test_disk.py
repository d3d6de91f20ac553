import errno
import os
import re
from pathlib import Path
from typing import Any

import pytest

from vvvaltr.controller.core.disk import make_own_folder, new_folder, read_text, write_whole


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


def test_an_interrupt_while_a_new_folder_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, mkdir = list[Path](), Path.mkdir

    def interrupted(path: Path, *args: Any, **options: Any) -> None:
        mkdir(path, *args, **options)
        if path.name.startswith(".a-"):
            made.append(path)
            raise KeyboardInterrupt

    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "a"):
        pass

    assert made and list(tmp_path.iterdir()) == []


def test_what_fails_in_a_new_folder_leaves_nothing_and_takes_no_others_place(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "log").write_text("of another run")

    with pytest.raises(OSError, match="not empty"), new_folder(tmp_path / "a") as fresh:
        (fresh / "log").write_text("mine")
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "b"):
        raise KeyboardInterrupt

    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a" / "log").read_text() == "of another run"


def test_an_interrupt_while_a_folder_gets_its_name_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rename = Path.rename

    def rename_and_interrupt(self: Path, target: Path) -> None:
        rename(self, target)
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "rename", rename_and_interrupt)
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "a"):
        pass

    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_program_left_of_a_folder_goes_and_what_another_makes_stays(tmp_path: Path) -> None:
    (tmp_path / ".a-12345678").mkdir()
    (tmp_path / ".a-12345678" / "log").write_text("half")

    with new_folder(tmp_path / "a") as first:
        assert not (tmp_path / ".a-12345678").exists()
        with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "a"):
            assert first.exists()
            raise KeyboardInterrupt

    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("name", ["a.toml", "a.toml.new"])
def test_nothing_is_written_through_a_link(tmp_path: Path, name: str) -> None:
    secret = tmp_path / "secret"
    secret.write_text("secret")
    (tmp_path / name).symlink_to(secret)

    write_whole(tmp_path / "a.toml", "new")

    assert (secret.read_text(), (tmp_path / "a.toml").read_text()) == ("secret", "new")


def test_a_folder_that_is_a_link_is_not_written_to(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "figures").symlink_to(tmp_path / "elsewhere")

    with pytest.raises(OSError, match="it is a link"):
        make_own_folder(tmp_path / "figures")


@pytest.mark.parametrize("name", ["fifo", "folder", "/dev/zero"])
def test_what_is_no_file_is_not_read(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "folder").mkdir()

    with pytest.raises(OSError, match="not a file"):
        read_text(tmp_path / name)


def test_every_file_that_is_read_is_opened_by_one_door() -> None:
    """What is opened in another way may be a pipe, on which a program waits for ever, or a device without an end."""
    raw = re.compile(r"\.read_text\(|\.read_bytes\(|[\w)]\.open\(\s*[\"']r|\bopen\([^)]*[\"']r")
    of_the_system = {  # files below /proc and /sys alone
        "controller/core/disk.py", "controller/robot/commissioning/plugged_in.py", "controller/runs/underway.py",
        "drivers/links/local.py",
    }  # fmt: skip
    root = Path(__file__).parents[3]
    found = {
        str(path.relative_to(root))
        for room in ("controller", "drivers", "twin", "transfer")
        for path in (root / room).rglob("*.py")
        if "firmware" not in path.parts and raw.search(path.read_text(encoding="utf-8"))
    }

    assert found - of_the_system == set()


def test_what_takes_the_place_of_a_folder_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "a.toml").mkdir()

    with pytest.raises(OSError, match=r"it is a directory, not a file.*a\.toml"):
        write_whole(tmp_path / "a.toml", "new")


@pytest.mark.parametrize("name", ["pipe", "link to a pipe"])
def test_what_is_no_file_is_not_replaced(tmp_path: Path, name: str) -> None:
    """Root would lose /dev/null, and with /dev/stdout, which is a link, the standard output of every program."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link to a pipe").symlink_to(tmp_path / "pipe")

    with pytest.raises(OSError, match="it is a named pipe, not a file"):
        write_whole(tmp_path / name, "new")

    assert (tmp_path / name).is_fifo()


def test_a_file_that_cannot_be_written_is_told_by_its_own_name(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as told:
        write_whole(tmp_path / "no" / "a.toml", "new")

    assert told.value.filename == str(tmp_path / "no" / "a.toml")


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "bom.toml").write_bytes(b"\xef\xbb\xbfa = 1")

    assert read_text(tmp_path / "bom.toml") == "a = 1"


@pytest.mark.parametrize("name", [".", "/", ".."])
def test_a_name_that_is_only_a_folders_is_refused_as_any_folder_is(name: str) -> None:
    with pytest.raises(OSError, match="it is a directory, not a file"):
        write_whole(Path(name), "")
