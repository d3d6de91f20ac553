"""Files and folders that are there whole or not at all, and outlast a power cut."""

from __future__ import annotations

import errno
import fcntl
import glob
import math
import os
import secrets
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_MOST_TEXT_BYTES = 16 << 20
_KINDS = {stat.S_IFIFO: "a named pipe", stat.S_IFDIR: "a directory", stat.S_IFSOCK: "a socket"}


def open_plain(path: Path, most_bytes: float = math.inf) -> BinaryIO:
    """Open an ordinary file to read it.

    Raises:
        OSError: there is none, or it is a pipe, a device or a directory, or it has more bytes.
    """
    _refuse_special(path, os.stat(path).st_mode)  # before it is opened: some devices act when they are
    file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")
    try:
        found = os.fstat(file.fileno())
        _refuse_special(path, found.st_mode)  # and after, for the name may lead elsewhere by now
        if found.st_size > most_bytes:
            raise OSError(
                errno.EFBIG, f"it has {found.st_size >> 20} MB, and {int(most_bytes) >> 20} MB is the most", str(path)
            )
    except BaseException:
        file.close()
        raise
    return file


def read_text(path: Path, most_bytes: int = _MOST_TEXT_BYTES) -> str:
    """Return the text of an ordinary file in UTF-8, without a byte-order mark.

    Raises:
        OSError: as ``open_plain`` does.
        UnicodeDecodeError: it is not UTF-8.
    """
    return read_bytes(path, most_bytes).decode("utf-8-sig")


def read_bytes(path: Path, most_bytes: int = _MOST_TEXT_BYTES) -> bytes:
    """Return the bytes of an ordinary file. Raises OSError as ``open_plain`` does."""
    with open_plain(path, most_bytes) as file:
        return file.read(most_bytes)


def _refuse_special(path: Path, mode: int) -> None:
    if not stat.S_ISREG(mode):
        kind = _KINDS.get(stat.S_IFMT(mode), "a device")
        raise OSError(errno.EINVAL, f"it is {kind}, not a file", str(path))


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, or replace it, in one step and down to the disk; text is written as UTF-8.

    A link at ``path`` is replaced, never followed.

    Raises:
        OSError: the file cannot be written, or it is a device or a pipe; the old one, if any, is unchanged.
    """
    with replacing(path) as fresh:
        fresh.write(content.encode() if isinstance(content, str) else content)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Yield a new file that takes the place of the one at ``path`` once the block is left. Raises OSError."""
    _refuse_to_replace(path)  # first: of a folder such as "." no other name can be made
    fresh = path.with_name(f"{path.name}.new")
    _refuse_to_replace(fresh)
    try:
        fresh.unlink(missing_ok=True)  # a left-over, or a link to somewhere
        with fresh.open("xb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(fresh, path)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename == str(fresh):
            error.filename = str(path)  # the name that a person knows
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise
    sync_folder(path)


def _refuse_to_replace(path: Path) -> None:
    """Raise OSError for a folder, a device or a pipe, and for a link to one of the last two: /dev/stdout is one."""
    with suppress(FileNotFoundError):
        mode = os.stat(path).st_mode
        if not (path.is_symlink() and stat.S_ISDIR(mode)):
            _refuse_special(path, mode)


def make_own_folder(path: Path) -> None:
    """Make a folder for files of ours, if it is not there.

    Raises:
        OSError: it cannot be made, or is a link, which would lead what is written elsewhere.
    """
    path.mkdir(parents=True, exist_ok=True)
    if path.is_symlink():
        raise OSError(errno.ELOOP, "it is a link: nothing is written through it; remove it", str(path))


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a folder that is called ``path`` once the block is left; what fails leaves nothing. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(path)
    fresh, handle = path.with_name(f".{path.name}-{secrets.token_hex(4)}"), -1
    try:
        fresh.mkdir()  # within the block, for an interrupt may come before the next line
        handle = os.open(fresh, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_SH | fcntl.LOCK_NB)
        yield fresh
        fresh.rename(path)
    except BaseException:
        # An interrupt may come when the folder has its name already: whoever asked for it does not get it then.
        shutil.rmtree(path if _is_same(path, handle) else fresh, ignore_errors=True)
        raise
    finally:
        if handle >= 0:
            os.close(handle)
    sync_folder(path)


def _remove_leftovers(path: Path) -> None:
    """Remove what earlier programs left that were killed while they made ``path``: folders that nobody has locked."""
    for left in path.parent.glob(f".{glob.escape(path.name)}-????????"):
        with suppress(OSError):
            handle = os.open(left, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left)
            finally:
                os.close(handle)


def _is_same(path: Path, handle: int) -> bool:
    try:
        return handle >= 0 and os.path.samestat(os.stat(path), os.fstat(handle))
    except OSError:
        return False


def sync_folder(path: Path) -> None:
    """Make the name of a file last, not only its bytes."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
