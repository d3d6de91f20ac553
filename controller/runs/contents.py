"""From the messages of a log to the run that they hold."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, TypeVar

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError, Message

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Command, MotorState, Pose, Suggestion
from vvvaltr.controller.loop.movement import measure_applied, measure_movement, measure_pieces
from vvvaltr.controller.runs.schema import codec
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.limits import check_message, check_size
from vvvaltr.controller.runs.schema.mcap_file import DamagedFile, Entry, TornFile, read_entries
from vvvaltr.controller.runs.schema.trial_codec import decode_trial
from vvvaltr.transfer.causes.pieces import MOST_PIECES

FORMAT = 2  # version 0.1 wrote format 1
_RECORDED = frozenset({"/robot/tracking", "/motors/command", "/motors/state", "/tracker/picture"})
"""Topics of what is recorded during a drive."""

_TOPICS = frozenset({"/run", "/optimizer/suggestion", "/trial", *_RECORDED})
"""All topics that a run is made of: the others draw it."""


def _nothing_recorded() -> dict[str, list[bytes]]:
    return {topic: [] for topic in _RECORDED}


@dataclass(slots=True)
class Contents:
    """What has been read of a log so far.

    Args:
        path: the log's name, for errors.
        recordings: whether to keep what was recorded during the drives: poses, commands, states and pictures.
    """

    path: Path
    recordings: bool = True
    is_torn: bool = False
    head: Run | None = None
    begin_ns: int = 0
    format: int = FORMAT
    suggestion: Suggestion | None = None
    recorded: dict[str, list[bytes]] = field(default_factory=_nothing_recorded)
    trials: list[LoggedTrial] = field(default_factory=list)

    def read_all(self, file: IO[bytes]) -> Run:
        """Return what an open log holds. Raises UserError as ``read`` does."""
        for _ in self.read(file, _TOPICS):
            pass
        return self.run()

    def read(self, file: IO[bytes], topics: Container[str] | None = None) -> Iterator[list[Entry]]:
        """Read an open log, and yield the messages of each complete trial once it has been added.

        Args:
            file: the log.
            topics: what to yield messages of; None for all. Those that a run is made of must be among them.

        Raises:
            UserError: the file is not the log of a run, is damaged, or was written by a newer version.
        """
        messages: list[Entry] = []
        try:
            for entry in read_entries(file, topics):
                messages.append(entry)
                self._take(entry)
                if entry.topic == "/trial":
                    yield messages
                    self._drop_recordings()
                if entry.topic in ("/trial", "/run"):
                    messages = []
            self._decode_recorded()  # of a trial without an end: wrong all the same, where it is
        except TornFile:
            self.is_torn = True
        except (DamagedFile, DecodeError, ValueError) as error:
            raise UserError(f"{self.path} is damaged ({error}): restore a copy of it, or begin a new run") from error

    def _drop_recordings(self) -> None:
        if self.trials and not self.recordings:
            self.trials[-1] = self.trials[-1].without_recordings()

    def _take(self, entry: Entry) -> None:
        """Add one message. What other programs have put on topics of their own is passed over."""
        topic, _, payload = entry
        check_size(topic, payload)
        if topic in _RECORDED:
            if self._needs_recordings:
                self.recorded[topic].append(payload)
            return
        match topic:
            case "/run":
                self.begin_ns = entry.log_time_ns
                self._begin(_checked(pb.Run.FromString(payload)))
            case "/optimizer/suggestion":
                self.suggestion = codec.decode_suggestion(_checked(pb.Suggestion.FromString(payload)))
            case "/trial":
                self._end_trial(_checked(pb.Trial.FromString(payload)))

    def run(self) -> Run:
        """Return what has been read, without a trial that has no end."""
        if self.head is None:
            raise UserError(f"{self.path} holds no run: give the log of one, or begin the run again")
        return replace(self.head, trials=tuple(self.trials))

    @property
    def _needs_recordings(self) -> bool:
        return self.recordings or self.format == 1  # whose movements are measured anew

    def _begin(self, message: pb.Run) -> None:
        if message.format > FORMAT:
            raise UserError(
                f"{self.path} has log format {message.format}, but this version reads up to {FORMAT}: upgrade vvvaltr"
            )
        self.head, self.format = codec.decode_run(message), message.format

    def _end_trial(self, message: pb.Trial) -> None:
        if self.suggestion is None:
            raise ValueError(f"trial {message.number} has no suggestion")
        poses, commands, states, pictures = self._decode_recorded()
        self._check_motors(message, self.suggestion, commands, states)
        logged = decode_trial(message, self.suggestion, poses, commands, states)
        began_ns = nanoseconds(logged.trial.started_unix_s)
        photos = tuple(codec.decode_photo(picture, began_ns) for picture in pictures)
        logged = replace(logged, trial=replace(logged.trial, photos=photos))
        logged = _with_movement(logged) if self.format == 1 else _with_pieces(logged)
        self.trials.append(logged)
        self.suggestion, self.recorded = None, _nothing_recorded()

    def _decode_recorded(
        self,
    ) -> tuple[tuple[Pose, ...], tuple[Command, ...], tuple[MotorState, ...], list[CompressedImage]]:
        """Return what was recorded since the last trial."""
        recorded = self.recorded
        return (
            codec.decode_poses(recorded["/robot/tracking"]),
            codec.decode_commands(recorded["/motors/command"]),
            codec.decode_states(recorded["/motors/state"]),
            [CompressedImage.FromString(payload) for payload in recorded["/tracker/picture"]],
        )

    def _check_motors(
        self, message: pb.Trial, suggestion: Suggestion, commands: Sequence[Command], states: Sequence[MotorState]
    ) -> None:
        """Raise ValueError unless everything of a run is about the same number of motors."""
        gaits = [message.gait, *message.steering.plan]
        if message.HasField("recommendation"):
            gaits.append(message.recommendation.gait)
        counts = {len(gait.frequency_hz) for gait in gaits} | {len(state.frequency_hz) for state in states}
        known = (suggestion.gait, *(each.gait for each in commands), *(each.trial.gait for each in self.trials[:1]))
        counts |= {gait.motor_count for gait in known}
        motors = len(message.gait.frequency_hz)
        if counts != {motors} or not motors:
            raise ValueError(f"trial {message.number} is not about {motors} motors as the others are")


_Message = TypeVar("_Message", bound=Message)


def _checked(message: _Message) -> _Message:
    """Return a message that a run could have written. Raises ValueError."""
    check_message(message)
    return message


def _with_movement(logged: LoggedTrial) -> LoggedTrial:
    """Return a trial of a log of format 1 with what its poses and states tell, which later formats keep beside them."""
    moved = replace(logged, movement=measure_movement(logged.trial), applied=measure_applied(logged.trial))
    return _with_pieces(moved)


def _with_pieces(logged: LoggedTrial) -> LoggedTrial:
    """Return a trial with the pieces that its poses make, where the log keeps none, as early ones do, or too many."""
    is_known = 0 < len(logged.pieces) <= MOST_PIECES
    return logged if is_known else replace(logged, pieces=measure_pieces(logged.trial))


def nanoseconds(seconds: float) -> int:
    """Return a time in nanoseconds."""
    return round(seconds * 1e9)
