"""Files and folders that are there whole or not at all, and outlast a power cut."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def write_whole(path: Path, content: str | bytes) -> None:
    """Write a file, or replace it, in one step and down to the disk; text is written as UTF-8.

    Raises:
        OSError: the file cannot be written; the old one, if any, is unchanged.
    """
    fresh = path.with_name(f"{path.name}.new")
    try:
        with fresh.open("wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(fresh, path)
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise
    sync_folder(path)


@contextmanager
def new_folder(path: Path) -> Iterator[Path]:
    """Yield a folder that is called ``path`` once the block is left; what fails leaves nothing. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = Path(tempfile.mkdtemp(prefix=f".{path.name}-", dir=path.parent))
    try:
        fresh.chmod(0o755)
        yield fresh
        fresh.rename(path)
    except BaseException:
        shutil.rmtree(fresh)
        raise
    sync_folder(path)


def sync_folder(path: Path) -> None:
    """Make the name of a file last, not only its bytes."""
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
