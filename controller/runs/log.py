"""The log of a run: one append-only MCAP file that holds everything needed to resume, score again, view or transfer it.

Each trial is one chunk, written and synced whole, so that a SIGKILL or a power cut loses at most the trial in progress.
docs/log.md describes the file for other programs.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import IO, BinaryIO, Self

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.message import Message

from vvvaltr import __version__
from vvvaltr.controller.core.disk import open_plain, replacing, sync_folder
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Command, MotorState, Photo, Pose, Source, Structure, Trial
from vvvaltr.controller.runs.contents import FORMAT, Contents, nanoseconds
from vvvaltr.controller.runs.schema import codec, drawing
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.limits import MOST_LOG_BYTES
from vvvaltr.controller.runs.schema.mcap_file import Entry, NewFile, describe, lock
from vvvaltr.controller.runs.schema.mcap_writer import ChunkWriter, Stamped
from vvvaltr.controller.runs.schema.trial_codec import encode_trial

LOG_NAME = "trials.mcap"
_KINDS: dict[str, type[Message]] = {
    "/run": pb.Run,
    "/optimizer/suggestion": pb.Suggestion,
    "/robot/pose": PoseInFrame,
    "/robot/tracking": pb.Tracking,
    "/tracker/picture": CompressedImage,
    "/motors/command": pb.Command,
    "/motors/state": pb.MotorState,
    "/trial": pb.Trial,
    **drawing.KINDS,
}

_CHUNK_MESSAGES = 400  # of trials that are in another file already; a new trial is a chunk of its own


class RunLog:
    """The log of a run, open for appending. One process at a time writes to a log."""

    def __init__(self, disk: NewFile, head: Run, begin_ns: int | None = None) -> None:
        self._disk = disk
        self._structure = head.structure
        self._writer = ChunkWriter(disk)
        self._channels = {
            topic: self._writer.register(topic, kind.DESCRIPTOR.full_name, describe(kind))
            for topic, kind in _KINDS.items()
        }
        self._end_ns = 0  # of the last trial
        if begin_ns is None:
            begin_ns = nanoseconds(head.trials[0].trial.started_unix_s) if head.trials else time.time_ns()
        begin_ns = max(0, begin_ns)  # a clock that was not set, as on a Raspberry Pi, may show a time before 1970
        self._writer.add_metadata("vvvaltr", dict(head.about))
        begin = [_entry("/run", begin_ns, codec.encode_run(FORMAT, head))]
        if head.structure is not None and head.structure.terrain is not None:
            begin.append(_entry("/ground", begin_ns, drawing.draw_ground(head.structure.terrain, begin_ns)))
        self._write(begin)
        for together in _in_chunks(map(self._messages, head.trials)):
            self._write(together)
        disk.sync()

    @classmethod
    def create(
        cls,
        path: Path,
        structure: Structure | None,
        sources: Sequence[Source] = (),
        about: Mapping[str, str] | None = None,
        trials: Sequence[LoggedTrial] = (),
    ) -> Self:
        """Begin a new log; the arguments are those of ``Run``. Trials that it begins with are synced together.

        Raises:
            FileExistsError: there is already a file at ``path``; it is unchanged.
            OSError: the file cannot be written.
        """
        disk = NewFile(path)
        try:
            log = cls(disk, Run(structure, tuple(sources), tuple(trials), about or {}))
            sync_folder(path)
        except BaseException:
            disk.close()
            path.unlink()
            raise
        return log

    @classmethod
    def recover(cls, path: Path, recordings: bool = True) -> tuple[Self, Run]:
        """Open a finished or torn log for more trials, as ``recovering`` does, and return it with its contents."""
        with cls.recovering(path, recordings) as found:
            return found

    @classmethod
    @contextmanager
    def recovering(cls, path: Path, recordings: bool = True) -> Iterator[tuple[Self, Run]]:
        """Open a finished or torn log for more trials; yields it with its contents, as ``read_run`` returns them.

        The complete trials are written to a new file, which takes the place of the old one in one step, once the body
        of the ``with`` statement has ended well. Where the old one ended in the middle of a trial, a copy of it is left
        beside the new one, with the ending ``.torn``.

        Raises:
            UserError: the file is not the log of a run, is damaged, or is being written by another process.
            OSError: the new file cannot be written; the old one is unchanged.
        """
        with _open(path) as file:
            lock(file, path)
            fresh = path.with_name(path.name + ".new")
            fresh.unlink(missing_ok=True)
            disk = NewFile(fresh)
            try:
                contents = Contents(path, recordings)
                yield cls._copying(disk, contents, file), contents.run()
                _keep_torn(file if contents.is_torn else None, path)
                os.replace(fresh, path)
                sync_folder(path)
            except BaseException:
                disk.close()
                fresh.unlink(missing_ok=True)
                raise

    @classmethod
    def _copying(cls, disk: NewFile, contents: Contents, file: IO[bytes]) -> Self:
        """Return a log in a new file that begins with all complete trials of another one, as the bytes that they are.

        Trials of an older format are written anew.
        """
        trials = contents.read(file)
        first = next(trials, None)
        log = cls(disk, replace(contents.run(), trials=()), contents.begin_ns)
        for together in _in_chunks(log._take_over(contents, trials, first)):
            log._write(together)
        disk.sync()
        return log

    def _take_over(
        self, contents: Contents, trials: Iterator[list[Entry]], first: list[Entry] | None
    ) -> Iterator[list[Entry]]:
        for messages in [] if first is None else chain([first], trials):
            if contents.format < FORMAT:
                yield self._messages(contents.trials[-1])
                continue
            self._end_ns = messages[-1].log_time_ns
            yield [message for message in messages if message.topic in self._channels and message.topic != "/ground"]

    def append(self, logged: LoggedTrial) -> None:
        """Write everything of one trial, and return once it is on the disk.

        Raises:
            ValueError: the log is closed, or the trial holds what no message can hold; nothing is written.
            OSError: the disk failed; the log is closed, and its earlier trials can be recovered.
        """
        if self._disk.closed:
            raise ValueError("the log is closed")
        if self._disk.is_gone():
            raise UserError("the folder of the run was deleted: the run ends here; begin a new one")
        messages = self._messages(logged)
        try:
            self._write(messages)
            self._disk.sync()
        except BaseException:
            # Half a trial may be written: nothing must follow it, or the file would be damaged instead of torn.
            self._disk.close()
            raise

    def is_at(self, path: Path) -> bool:
        """Return whether the log is still the file at ``path``."""
        return not self._disk.closed and self._disk.is_at(path)

    def close(self) -> None:
        """Finish the file, so that every MCAP program can read it. Idempotent; does nothing after a failed ``append``.

        Raises:
            OSError: the disk failed; the trials are safe.
        """
        if self._disk.closed:
            return
        try:
            self._writer.finish()
            self._disk.sync()
        finally:
            self._disk.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _messages(self, logged: LoggedTrial) -> list[Entry]:
        trial = logged.trial
        origin_ns, end_ns = find_trial_span_ns(trial, after_ns=self._end_ns)
        messages: list[Entry] = [_entry("/optimizer/suggestion", origin_ns, codec.encode_suggestion(logged.suggestion))]
        for pose in trial.poses:
            at_ns = origin_ns + nanoseconds(pose.t_s)
            messages.append(_entry("/robot/tracking", at_ns, codec.encode_tracking(pose)))
            if pose.is_finite:
                messages.append(_entry("/robot/pose", at_ns, codec.encode_pose(pose, at_ns)))
        messages += [
            _entry("/motors/command", origin_ns + nanoseconds(each.t_s), codec.encode_command(each))
            for each in trial.commands
        ]
        messages += [
            _entry("/motors/state", origin_ns + nanoseconds(each.t_s), codec.encode_state(each))
            for each in trial.states
        ]
        log_bytes = sum(drawing.count_bytes(len(entry.payload)) for entry in messages)
        drawn = drawing.draw_trial(trial.poses, self._structure, origin_ns, log_bytes)
        messages += [_entry(topic, at_ns, message) for topic, at_ns, message in drawn]
        began_ns = nanoseconds(trial.started_unix_s)
        for photo in trial.photos:
            at_ns = origin_ns + nanoseconds(photo.t_s)
            messages.append(_entry("/tracker/picture", at_ns, codec.encode_photo(photo, began_ns)))
        messages.append(_entry("/trial", end_ns, encode_trial(logged)))
        self._end_ns = end_ns
        return messages

    def _write(self, messages: Iterable[Entry]) -> None:
        """Write messages as one chunk."""
        channels = self._channels
        self._writer.write(Stamped(channels[topic], at_ns, payload) for topic, at_ns, payload in messages)


def _entry(topic: str, at_ns: int, message: Message) -> Entry:
    return Entry(topic, at_ns, message.SerializeToString())


def _in_chunks(trials: Iterable[list[Entry]]) -> Iterator[list[Entry]]:
    """Yield the messages of whole trials together, until there are enough for a chunk."""
    together: list[Entry] = []
    for messages in trials:
        together += messages
        if len(together) >= _CHUNK_MESSAGES:
            yield together
            together = []
    if together:
        yield together


def describe_maker(robot: str = "", seed: int | None = None) -> dict[str, str]:
    """Return what makes a log that begins now, for ``Run.about``: version of vvvaltr, date, name of the robot, seed."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    about = {"version": __version__, "date": date, "robot": robot, "seed": "" if seed is None else str(seed)}
    return {key: value for key, value in about.items() if value}


def find_trial_span_ns(trial: Trial, after_ns: int) -> tuple[int, int]:
    """Return where a trial begins and ends in its log, in nanoseconds since 1970.

    A twin runs faster than real time, so that the trials of a run would overlap: a trial begins at its wall time or at
    the end of the last one (``after_ns``), whichever is later. Nothing in it is before 1970, whatever the clock shows.
    """
    recorded: Iterable[Pose | Command | MotorState | Photo] = chain(
        trial.poses, trial.commands, trial.states, trial.photos
    )
    times_s = (0.0, trial.duration_s, *(each.t_s for each in recorded))  # the first pose is older than the drive
    begin_ns = max(nanoseconds(trial.started_unix_s), after_ns, -nanoseconds(min(times_s)))
    return begin_ns, begin_ns + nanoseconds(max(times_s))


def read_run(path: Path, recordings: bool = True) -> Run:
    """Return the contents of a log: the file, or the one in the directory of a run; of a torn log the complete trials.

    Without ``recordings`` the trials lack what was recorded during their drives: poses, commands, states and pictures.

    Raises:
        UserError: the file does not exist, is not the log of a run, is damaged, or was written by a newer version.
    """
    path = path / LOG_NAME if path.is_dir() else path
    with _open(path) as file:
        return Contents(path, recordings).read_all(file)


def read_trials(path: Path) -> Iterator[LoggedTrial]:
    """Yield the trials of a log one by one, so that a long one need not fit into memory. Raises as ``read_run``."""
    path = path / LOG_NAME if path.is_dir() else path
    contents = Contents(path)
    with _open(path) as file:
        for _ in contents.read(file):
            yield contents.trials.pop()
    contents.run()


def _keep_torn(file: BinaryIO | None, path: Path) -> None:
    """Copy a torn log beside itself; the copy is removed when the log is next found whole."""
    copy = path.with_name(path.name + ".torn")
    if file is None:
        copy.unlink(missing_ok=True)
        return
    file.seek(0)
    with replacing(copy) as fresh:
        shutil.copyfileobj(file, fresh)


def _open(path: Path) -> BinaryIO:
    try:
        return open_plain(path, MOST_LOG_BYTES)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}; name the directory of a run, or its {LOG_NAME}") from error
