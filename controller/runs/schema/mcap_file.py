"""MCAP files of protobuf messages, written to survive a full disk, and read even where they are torn or hostile."""

from __future__ import annotations

import fcntl
import os
import struct
import zlib
from collections.abc import Container, Iterator
from io import BytesIO, FileIO
from pathlib import Path
from typing import IO, NamedTuple, cast

from google.protobuf.descriptor import FileDescriptor
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message as Protobuf
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk
from mcap.writer import MCAP0_MAGIC

from vvvaltr.controller.core.errors import UserError

_MOST_RECORD_BYTES = 256 << 20  # a trial of four hours
_WRITTEN = "{} is being written by another process; wait for it, or stop it"
# What the library raises on bytes that stop short or are wrong.
_WRONG = (McapError, struct.error, ValueError, OverflowError, KeyError)


_RECORD, _MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")  # what a record, and a message, begin with

_READ = frozenset({Opcode.CHUNK, Opcode.CHANNEL, Opcode.MESSAGE})


class Entry(NamedTuple):
    """A message of a file: its topic, its time in nanoseconds since 1970, and its bytes."""

    topic: str
    log_time_ns: int
    payload: bytes


class _Topics:
    """The topics of a file's channels, of which some may be wanted alone."""

    def __init__(self, wanted: Container[str] | None) -> None:
        self._wanted = wanted
        self.names: dict[int, str | None] = {}  # by channel; None for one that is passed over

    def declare(self, channel: int, topic: str) -> None:
        """Note the topic of a channel."""
        self.names[channel] = topic if self._wanted is None or topic in self._wanted else None


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
        return _is_at(self._file, path)

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
        raise UserError(_WRITTEN.format(path)) from error
    except OSError:
        return  # a file system without locks; the log itself needs none
    if not _is_at(file, path):  # another process has put a new file in its place since it was opened
        raise UserError(_WRITTEN.format(path))


def _is_at(file: IO[bytes] | FileIO, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def describe(kind: type[Protobuf]) -> bytes:
    """Return the schema of one kind of message, with all that it imports."""
    files: dict[str, FileDescriptor] = {}
    _collect(cast(FileDescriptor, kind.DESCRIPTOR.file), files)
    schema = FileDescriptorSet()
    for file in files.values():
        file.CopyToProto(schema.file.add())
    return schema.SerializeToString()


def _collect(file: FileDescriptor, files: dict[str, FileDescriptor]) -> None:
    """Add a file behind all that it imports."""
    for imported in file.dependencies:
        _collect(imported, files)
    files.setdefault(file.name, file)


def read_entries(file: IO[bytes], wanted: Container[str] | None = None) -> Iterator[Entry]:
    """Yield every message of a file that is open at its beginning, in the order in which they were written.

    No more of it is in memory than one record. With ``wanted``, messages on other topics are passed over.

    Raises:
        TornFile: the end is missing. All complete messages have been yielded.
        DamagedFile: it is not an MCAP file, or wrong bytes precede right ones.
    """
    size = file.seek(0, os.SEEK_END)
    finished = size >= len(MCAP0_MAGIC) and _read_at(file, size - len(MCAP0_MAGIC)) == MCAP0_MAGIC
    if _read_at(file, 0) != MCAP0_MAGIC:
        raise DamagedFile("not an MCAP file")
    file.seek(0)
    topics = _Topics(wanted)
    whole, wrong = 0, False
    try:
        for kind, content, end in _read_records(file, size):
            try:
                found = _messages(kind, content, topics)
            except _WRONG:  # of this record alone: its length was right, so the next one can be read
                wrong = True
                continue
            if found and wrong:
                raise DamagedFile(f"after byte {whole}")
            yield from found
            whole = end
    except EndOfFile:
        wrong = wrong or whole < size
    except _WRONG:
        wrong = True
    if wrong:
        raise (DamagedFile if finished and size > len(MCAP0_MAGIC) else TornFile)(f"after byte {whole}")


def _read_at(file: IO[bytes], place: int) -> bytes:
    file.seek(place)
    return file.read(len(MCAP0_MAGIC))


def _read_records(file: IO[bytes], size: int) -> Iterator[tuple[int, bytes, int]]:
    """Yield kind, content and end of all records up to the footer. Of those that do not matter here none is read.

    Raises:
        EndOfFile: a record is longer than the rest of the file, or there is no footer.
    """
    at = len(MCAP0_MAGIC)
    while True:
        file.seek(at)
        kind, length = _RECORD.unpack(file.read(_RECORD.size).ljust(_RECORD.size, b"\0"))
        at += _RECORD.size + length
        if kind == 0 or at > size:
            raise EndOfFile
        if length > _MOST_RECORD_BYTES:
            raise McapError("a record that is larger than any run writes")
        yield kind, file.read(length) if kind in _READ else b"", at
        if kind == Opcode.FOOTER:
            return


def _messages(kind: int, content: bytes, topics: _Topics) -> list[Entry]:
    """Return the messages in one record, and note the topics of the channels in it."""
    if kind != Opcode.CHUNK:
        return _split(_RECORD.pack(kind, len(content)) + content, topics)
    return _unpack(Chunk.read(ReadDataStream(BytesIO(content))), topics)


def _unpack(chunk: Chunk, topics: _Topics) -> list[Entry]:
    """Return the messages of a chunk, in a tenth of the time that the library takes for its objects."""
    if chunk.compression:
        raise DamagedFile("its chunks are compressed, which no run writes")
    if chunk.uncompressed_crc and zlib.crc32(chunk.data) != chunk.uncompressed_crc:
        raise McapError("a chunk with a wrong checksum")
    return _split(chunk.data, topics)


def _split(data: bytes, topics: _Topics) -> list[Entry]:
    """Return the messages in some records, and note the topics of the channels in them."""
    found, at, size = [], 0, len(data)
    head, message_head = _RECORD.size, _MESSAGE.size
    read_record, read_message, names = _RECORD.unpack_from, _MESSAGE.unpack_from, topics.names
    message, declaration = int(Opcode.MESSAGE), int(Opcode.CHANNEL)
    while at < size:
        kind, length = read_record(data, at)
        begin = at + head
        at = begin + length
        if at > size:
            raise McapError("a record that is longer than its chunk")
        if kind == message:
            channel, _, log_time_ns, _ = read_message(data, begin)
            if (topic := names[channel]) is not None:
                found.append(Entry(topic, log_time_ns, data[begin + message_head : at]))
        elif kind == declaration:
            inner = Channel.read(ReadDataStream(BytesIO(data[begin:at])))
            topics.declare(inner.id, inner.topic)
    return found
