"""MCAP files of protobuf messages, written to survive a full disk, and read even where they are torn or hostile."""

from __future__ import annotations

import fcntl
import os
import struct
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from typing import IO, BinaryIO, cast

from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message
from mcap.exceptions import EndOfFile, McapError
from mcap.records import Channel, Chunk, McapRecord
from mcap.records import Message as Entry
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import MCAP0_MAGIC, Writer

from vvvaltr.controller.core.errors import UserError

_MOST_RECORD_BYTES = 256 << 20  # a trial of four hours
# What the library raises on bytes that stop short or are wrong.
_WRONG = (McapError, struct.error, ValueError, OverflowError, KeyError)


class TornFile(Exception):
    """The file was never finished, and its last record is incomplete."""


class DamagedFile(Exception):
    """The file is not an MCAP file, or its bytes have changed."""


class NewFile:
    """A locked, unbuffered new file: after a failed write, closing it writes nothing."""

    def __init__(self, path: Path) -> None:
        self._file = FileIO(path, "x")
        lock(self._file, path)

    def is_gone(self) -> bool:
        """Return whether the file has no name any more."""
        return os.fstat(self._file.fileno()).st_nlink == 0

    def is_at(self, path: Path) -> bool:
        """Return whether the file is called ``path``."""
        try:
            return os.path.samestat(os.fstat(self._file.fileno()), path.stat())
        except OSError:
            return False

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    def write(self, data: bytes) -> int:
        """Write all of ``data``."""
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        return len(data)

    def tell(self) -> int:
        """Return how many bytes the file holds."""
        return self._file.tell()

    def flush(self) -> None:
        """Do nothing: no byte is held back. `sync` makes them last."""

    def sync(self) -> None:
        """Return once all bytes are on the disk."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close and unlock. Idempotent."""
        self._file.close()


def lock(file: IO[bytes] | FileIO, path: Path) -> None:
    """Keep other processes from writing to an open file until it is closed.

    Raises:
        UserError: another process is writing to it.
    """
    try:
        fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise UserError(f"{path} is being written by another process; wait for it, or stop it") from error
    except OSError:
        pass  # a file system without locks; the log itself needs none


def register(writer: Writer, topic: str, kind: type[Message]) -> int:
    """Open a topic for one kind of message, and return its channel."""
    files: dict[str, FileDescriptor] = {}
    _collect(cast(FileDescriptor, kind.DESCRIPTOR.file), files)
    schema = FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(schema.file.add())
    number = writer.register_schema(kind.DESCRIPTOR.full_name, SchemaEncoding.Protobuf, schema.SerializeToString())
    return writer.register_channel(topic, MessageEncoding.Protobuf, number)


def _collect(file: FileDescriptor, files: dict[str, FileDescriptor]) -> None:
    """Add a file behind all that it imports."""
    for imported in file.dependencies:
        _collect(imported, files)
    files.setdefault(file.name, file)


class _Remaining:
    """A file of which never more is asked than there is: memory is taken for what is asked."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size

    def read(self, count: int = -1) -> bytes:
        left = self._size - self._file.tell()
        return self._file.read(left if count < 0 else min(count, left))

    def tell(self) -> int:
        return self._file.tell()


def read_entries(file: BinaryIO) -> Iterator[tuple[str, bytes]]:
    """Yield topic and payload of every message in a file, in the order in which they were written.

    No more of it is in memory than one record.

    Raises:
        TornFile: the end is missing. All complete messages have been yielded.
        DamagedFile: it is not an MCAP file, or wrong bytes precede right ones.
    """
    if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
        raise DamagedFile("not an MCAP file")
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    topics: dict[int, str] = {}
    whole, wrong = 0, False
    try:
        stream = cast(IO[bytes], _Remaining(file, size))
        for record in StreamReader(stream, emit_chunks=True, record_size_limit=min(size, _MOST_RECORD_BYTES)).records:
            try:
                found = _messages(record, topics)
            except _WRONG:  # of this record alone: its length was right, so the next one can be read
                wrong = True
                continue
            if found and wrong:
                raise DamagedFile(f"after byte {whole}")
            yield from found
            whole = file.tell()
    except EndOfFile:
        wrong = wrong or whole < size
    except _WRONG:
        wrong = True
    if wrong:
        file.seek(max(len(MCAP0_MAGIC), size - len(MCAP0_MAGIC)))
        finished = file.read() == MCAP0_MAGIC
        raise (DamagedFile if finished else TornFile)(f"after byte {whole}")


def _messages(record: McapRecord, topics: dict[int, str]) -> list[tuple[str, bytes]]:
    """Return topic and payload of the messages in one record, and note the topics of the channels in it."""
    found = []
    for inner in _unpacked(record) if isinstance(record, Chunk) else [record]:
        if isinstance(inner, Channel):
            topics[inner.id] = inner.topic
        elif isinstance(inner, Entry):
            found.append((topics[inner.channel_id], inner.data))
    return found


def _unpacked(chunk: Chunk) -> list[McapRecord]:
    if chunk.compression:
        raise DamagedFile("its chunks are compressed, which no run writes")
    return breakup_chunk(chunk, validate_crc=True)
