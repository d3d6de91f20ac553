"""The log of a run: one append-only MCAP file that holds everything needed to resume, score again, view or transfer it.

Each trial is one chunk, written and synced whole, so that a SIGKILL or a power cut loses at most the trial in progress.
docs/log.md describes the file for other programs.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, BinaryIO, Self, TypeVar, cast

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from google.protobuf.message import DecodeError, Message
from mcap.writer import CompressionType, Writer

from vvvaltr import __version__
from vvvaltr.controller.core.disk import open_plain, replacing, sync_folder
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Command, MotorState, Photo, Pose, Source, Structure, Suggestion, Trial
from vvvaltr.controller.loop.movement import measure_applied, measure_movement
from vvvaltr.controller.runs.schema import codec, drawing
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.limits import MOST_LOG_BYTES, check_message, check_record, check_size
from vvvaltr.controller.runs.schema.mcap_file import DamagedFile, NewFile, TornFile, lock, read_entries, register
from vvvaltr.controller.runs.schema.trial_codec import decode_trial, encode_trial

LOG_NAME = "trials.mcap"
FORMAT = 2  # version 0.1 wrote format 1
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

_Timed = tuple[str, int, Message]  # topic, log time in ns since 1970, message


class RunLog:
    """The log of a run, open for appending. One process at a time writes to a log."""

    def __init__(self, disk: NewFile, head: Run) -> None:
        self._disk = disk
        self._structure = head.structure
        # Uncompressed, so that no file can unpack to more than its size; a chunk ends only where `_write` flushes it.
        self._writer = Writer(cast(IO[Any], disk), chunk_size=1 << 60, compression=CompressionType.NONE)
        self._writer.start()
        self._channels = {topic: register(self._writer, topic, kind) for topic, kind in _KINDS.items()}
        self._end_ns = 0  # of the last trial
        begin_ns = _ns(head.trials[0].trial.started_unix_s) if head.trials else time.time_ns()
        begin_ns = max(0, begin_ns)  # a clock that was not set, as on a Raspberry Pi, may show a time before 1970
        self._writer.add_metadata("vvvaltr", dict(head.about))
        begin: list[_Timed] = [("/run", begin_ns, codec.encode_run(FORMAT, head))]
        if head.structure is not None and head.structure.terrain is not None:
            begin.append(("/ground", begin_ns, drawing.draw_ground(head.structure.terrain, begin_ns)))
        self._write(begin)
        for logged in head.trials:
            self._write(self._messages(logged))
        disk.sync()

    @classmethod
    def create(
        cls,
        path: Path,
        structure: Structure | None,
        sources: Sequence[Source] = (),
        about: Mapping[str, str] | None = None,
    ) -> Self:
        """Begin a new log; the arguments are those of ``Run``.

        Raises:
            FileExistsError: there is already a file at ``path``; it is unchanged.
            OSError: the file cannot be written.
        """
        disk = NewFile(path)
        try:
            log = cls(disk, Run(structure, tuple(sources), about=about or {}))
            sync_folder(path)
        except BaseException:
            disk.close()
            path.unlink()
            raise
        return log

    @classmethod
    def recover(cls, path: Path) -> tuple[Self, Run]:
        """Open a finished or torn log for more trials, and return it with its contents.

        The complete trials are written to a new file, which then takes the place of the old one in one step. Where the
        old one ended in the middle of a trial, a copy of it is left beside the new one, with the ending ``.torn``.

        Raises:
            UserError: the file is not the log of a run, is damaged, or is being written by another process.
            OSError: the new file cannot be written; the old one is unchanged.
        """
        with _open(path) as file:
            lock(file, path)
            run, torn = _parse(file, path)
            _keep_torn(file if torn else None, path)
            return cls._replacing(path, run), run

    @classmethod
    def _replacing(cls, path: Path, run: Run) -> Self:
        fresh = path.with_name(path.name + ".new")
        fresh.unlink(missing_ok=True)
        disk = NewFile(fresh)
        try:
            log = cls(disk, run)
            os.replace(fresh, path)
            sync_folder(path)
        except BaseException:
            disk.close()
            fresh.unlink(missing_ok=True)
            raise
        return log

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
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._disk.sync()
        finally:
            self._disk.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _messages(self, logged: LoggedTrial) -> list[_Timed]:
        trial = logged.trial
        origin_ns, end_ns = find_trial_span_ns(trial, after_ns=self._end_ns)
        messages: list[_Timed] = [("/optimizer/suggestion", origin_ns, codec.encode_suggestion(logged.suggestion))]
        for pose in trial.poses:
            at_ns = origin_ns + _ns(pose.t_s)
            messages.append(("/robot/tracking", at_ns, codec.encode_tracking(pose)))
            if pose.is_finite:
                messages.append(("/robot/pose", at_ns, codec.encode_pose(pose, at_ns)))
        messages += [
            ("/motors/command", origin_ns + _ns(each.t_s), codec.encode_command(each)) for each in trial.commands
        ]
        messages += [("/motors/state", origin_ns + _ns(each.t_s), codec.encode_state(each)) for each in trial.states]
        log_bytes = sum(drawing.count_bytes(message) for _, _, message in messages)
        messages += drawing.draw_trial(trial.poses, self._structure, origin_ns, log_bytes)
        began_ns = _ns(trial.started_unix_s)
        for photo in trial.photos:
            at_ns = origin_ns + _ns(photo.t_s)
            messages.append(("/tracker/picture", at_ns, codec.encode_photo(photo, began_ns)))
        messages.append(("/trial", end_ns, encode_trial(logged)))
        self._end_ns = end_ns
        return messages

    def _write(self, messages: Iterable[_Timed]) -> None:
        """Write messages as one chunk."""
        for topic, at_ns, message in messages:
            self._writer.add_message(self._channels[topic], at_ns, message.SerializeToString(), at_ns)
        self._writer.flush()  # type: ignore[no-untyped-call]


def describe_maker(robot: str = "", seed: int | None = None) -> dict[str, str]:
    """Return what makes a log that begins now, for ``Run.about``: version of vvvaltr, date, name of the robot, seed."""
    date = datetime.now(UTC).isoformat(timespec="seconds")
    about = {"version": __version__, "date": date, "robot": robot, "seed": "" if seed is None else str(seed)}
    return {key: value for key, value in about.items() if value}


def find_trial_span_ns(trial: Trial, after_ns: int) -> tuple[int, int]:
    """Return where a trial begins and ends in its log, in nanoseconds since 1970.

    A twin runs faster than real time, so that the trials of a run would overlap: a trial begins at its wall time or at
    the end of the last one (``after_ns``), whichever is later.
    """
    begin_ns = max(_ns(trial.started_unix_s), after_ns)
    recorded: Iterable[Pose | Command | MotorState | Photo] = (
        *trial.poses,
        *trial.commands,
        *trial.states,
        *trial.photos,
    )
    return begin_ns, begin_ns + _ns(max((trial.duration_s, *(each.t_s for each in recorded))))


def read_run(path: Path) -> Run:
    """Return the contents of a log: the file, or the one in the directory of a run; of a torn log the complete trials.

    Raises:
        UserError: the file does not exist, is not the log of a run, is damaged, or was written by a newer version.
    """
    path = path / LOG_NAME if path.is_dir() else path
    with _open(path) as file:
        return _parse(file, path)[0]


def _parse(file: BinaryIO, path: Path) -> tuple[Run, bool]:
    """Return the contents of a log, and whether it was cut off."""
    contents = _Contents(path)
    torn = False
    try:
        for topic, payload in read_entries(file):
            contents.take(topic, payload)
    except TornFile:
        torn = True
    except (DamagedFile, DecodeError, ValueError) as error:
        raise UserError(f"{path} is damaged ({error}): restore a copy of it, or begin a new run") from error
    return contents.run(), torn


@dataclass(slots=True)
class _Contents:
    """What has been read of a log so far."""

    path: Path
    head: Run | None = None
    format: int = FORMAT
    suggestion: Suggestion | None = None
    poses: list[Pose] = field(default_factory=list)
    commands: list[Command] = field(default_factory=list)
    states: list[MotorState] = field(default_factory=list)
    pictures: list[CompressedImage] = field(default_factory=list)
    trials: list[LoggedTrial] = field(default_factory=list)

    def take(self, topic: str, payload: bytes) -> None:
        """Add one message. What other programs have put on topics of their own is passed over."""
        check_size(topic, payload)
        match topic:
            case "/run":
                self._begin(_checked(pb.Run.FromString(payload)))
            case "/optimizer/suggestion":
                self.suggestion = codec.decode_suggestion(_checked(pb.Suggestion.FromString(payload)))
            case "/robot/tracking":
                self.poses.append(codec.decode_tracking(_recorded(pb.Tracking.FromString(payload))))
            case "/motors/command":
                self.commands.append(codec.decode_command(_recorded(pb.Command.FromString(payload))))
            case "/motors/state":
                self.states.append(codec.decode_state(_recorded(pb.MotorState.FromString(payload))))
            case "/tracker/picture":
                self.pictures.append(CompressedImage.FromString(payload))
            case "/trial":
                self._end_trial(_checked(pb.Trial.FromString(payload)))

    def run(self) -> Run:
        """Return what has been read, without a trial that has no end."""
        if self.head is None:
            raise UserError(f"{self.path} holds no run: give the log of one, or begin the run again")
        return replace(self.head, trials=tuple(self.trials))

    def _begin(self, message: pb.Run) -> None:
        if message.format > FORMAT:
            raise UserError(
                f"{self.path} has log format {message.format}, but this version reads up to {FORMAT}: upgrade vvvaltr"
            )
        self.head, self.format = codec.decode_run(message), message.format

    def _end_trial(self, message: pb.Trial) -> None:
        if self.suggestion is None:
            raise ValueError(f"trial {message.number} has no suggestion")
        self._check_motors(message)
        logged = decode_trial(message, self.suggestion, self.poses, self.commands, self.states)
        began_ns = _ns(logged.trial.started_unix_s)
        photos = tuple(codec.decode_photo(picture, began_ns) for picture in self.pictures)
        logged = replace(logged, trial=replace(logged.trial, photos=photos))
        self.trials.append(_with_movement(logged) if self.format == 1 else logged)
        self.suggestion, self.poses, self.commands, self.states, self.pictures = None, [], [], [], []

    def _check_motors(self, message: pb.Trial) -> None:
        """Raise ValueError unless everything of a run is about the same number of motors."""
        gaits = [message.gait, *message.steering.plan]
        if message.HasField("recommendation"):
            gaits.append(message.recommendation.gait)
        counts = {len(gait.frequency_hz) for gait in gaits} | {len(state.frequency_hz) for state in self.states}
        known = (self.suggestion, *self.commands, *(logged.trial for logged in self.trials[:1]))
        counts |= {each.gait.motor_count for each in known if each is not None}
        motors = len(message.gait.frequency_hz)
        if counts != {motors} or not motors:
            raise ValueError(f"trial {message.number} is not about {motors} motors as the others are")


_Message = TypeVar("_Message", bound=Message)
_Record = TypeVar("_Record", pb.Tracking, pb.Command, pb.MotorState)


def _checked(message: _Message) -> _Message:
    """Return a message that a run could have written. Raises ValueError."""
    check_message(message)
    return message


def _recorded(message: _Record) -> _Record:
    """Return what a trial could have recorded. Raises ValueError."""
    check_record(message)
    return message


def _with_movement(logged: LoggedTrial) -> LoggedTrial:
    """Return a trial of a log of format 1 with what its poses and states tell, which later formats keep beside them."""
    return replace(logged, movement=measure_movement(logged.trial), applied=measure_applied(logged.trial))


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)


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
