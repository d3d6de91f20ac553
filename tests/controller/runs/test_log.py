from __future__ import annotations

import math
import re
import resource
import signal
import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from sample_run import SOURCE, STRUCTURE, logged_trial, sample_run
from scipy.spatial.transform import Rotation

from vvvaltr.controller.core.conditions import Conditions
from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import (
    AppliedFrequencies,
    Displacement,
    Fit,
    LoggedTrial,
    Movement,
    Review,
    Run,
    SteeringStep,
    Verdict,
)
from vvvaltr.controller.core.resting import RestingPose
from vvvaltr.controller.core.values import (
    Command,
    Estimate,
    MotorState,
    Outcome,
    Phase,
    Photo,
    Pose,
    Recommendation,
    Suggestion,
    Trial,
)
from vvvaltr.controller.runs.log import LOG_NAME, RunLog, read_run, read_trials
from vvvaltr.controller.runs.schema import codec
from vvvaltr.controller.runs.schema import vvvaltr_pb2 as pb
from vvvaltr.controller.runs.schema.mcap_file import NewFile, describe, lock
from vvvaltr.controller.runs.schema.mcap_writer import ChunkWriter, Stamped
from vvvaltr.controller.runs.schema.trial_codec import decode_trial

RUN = sample_run()


def write(path: Path, run: Run = RUN) -> Path:
    with RunLog.create(path, run.structure, run.sources, run.about) as log:
        for logged in run.trials:
            log.append(logged)
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write(tmp_path_factory.mktemp("finished") / LOG_NAME, sample_run(trials=3, poses=3)).read_bytes()


def unfinished_log(path: Path, run: Run) -> bytes:
    log = RunLog.create(path, run.structure, run.sources, run.about)
    for logged in run.trials:
        log.append(logged)
    data = path.read_bytes()
    log.close()
    return data


# What is written is read.


def test_a_run_reads_back_equal(tmp_path: Path) -> None:
    assert read_run(write(tmp_path / LOG_NAME)) == RUN


def test_a_run_is_named_by_its_directory_too(tmp_path: Path) -> None:
    write(tmp_path / LOG_NAME)
    assert read_run(tmp_path) == RUN


def test_a_run_without_structure_sources_or_trials_reads_back_equal(tmp_path: Path) -> None:
    assert read_run(write(tmp_path / LOG_NAME, Run())) == Run()


numbers = st.floats(-1000.0, 1000.0)
times = st.floats(0, 1e4)
maybe = st.none() | numbers
counts = st.integers(0, 2**31)
three = st.tuples(numbers, numbers, numbers)
gaits = st.builds(Gait, three, three, st.tuples(*[st.floats(0, 1)] * 3))
estimates = st.builds(Estimate, numbers, numbers, numbers)
vectors = st.tuples(numbers, numbers, numbers)


def lists(each: st.SearchStrategy) -> st.SearchStrategy:
    return st.lists(each, max_size=3).map(tuple)


rests = st.builds(RestingPose, vectors, numbers, numbers, numbers, maybe, maybe, counts)
trials = st.builds(
    Trial,
    st.integers(1, 2**31),
    gaits,
    st.sampled_from(Outcome),
    st.text(),
    st.floats(0, 4e9),
    times,
    lists(st.builds(Pose, times, vectors, numbers, numbers, numbers, lists(vectors), st.none(), maybe)),
    lists(st.builds(Command, times, gaits, numbers)),
    lists(st.builds(MotorState, times, three, st.booleans(), lists(numbers), lists(numbers))),
    st.builds(Conditions, maybe, maybe, st.booleans(), counts, maybe, maybe),
    st.none() | rests,
    st.none() | rests,
    lists(st.builds(Photo, st.integers(0, 10**10).map(lambda us: us / 1e6), st.binary(max_size=20))),
)
texts = st.text(max_size=5)
names_and_numbers = st.dictionaries(texts, numbers, max_size=3)
displacements = st.builds(Displacement, numbers, numbers, numbers)
logged_trials = st.builds(
    LoggedTrial,
    st.builds(Suggestion, gaits, st.text(), st.none() | estimates, names_and_numbers, st.sampled_from(Phase)),
    trials,
    st.none() | st.floats(-5.0, 5.0),
    st.none() | st.builds(Recommendation, gaits, estimates),
    st.none() | st.builds(Movement, rests, rests, displacements),
    st.none() | st.builds(AppliedFrequencies, lists(numbers), st.booleans()),
    st.builds(Review, texts, st.none() | st.sampled_from(Verdict), texts, st.booleans(), texts),
    st.none() | st.builds(Fit, names_and_numbers, st.booleans()),
    st.none() | st.builds(SteeringStep, st.tuples(numbers, numbers), maybe, displacements, maybe, maybe, lists(gaits)),
)


@given(st.lists(logged_trials, max_size=3))
@settings(max_examples=60, deadline=None)
def test_every_number_and_text_survives_exactly(tmp_path_factory: pytest.TempPathFactory, logged: list) -> None:
    run = Run(None, (), tuple(logged))
    assert read_run(write(tmp_path_factory.mktemp("run") / LOG_NAME, run)) == run


def test_a_pose_that_is_no_number_is_logged_for_the_record(tmp_path: Path) -> None:
    lost = Trial(1, Gait((1.0,)), Outcome.FAULTED, "no number", 0.0, 0.1, (Pose(0.0, (float("inf"), 0.0, 0.0)),))
    run = Run(trials=(LoggedTrial(Suggestion(lost.gait, "initial design"), lost, None, None),))
    assert read_run(write(tmp_path / LOG_NAME, run)) == run


@pytest.mark.parametrize(
    "change",
    [
        {"duration_s": math.nan},
        {"started_unix_s": math.inf},
        {"score_m_s": math.nan},
        {"score_m_s": math.inf},
        {"score_m_s": 66.0},
        {"movement": pb.Movement(displacement=pb.Displacement(turn_rad=math.nan))},
        {"movement": pb.Movement(start=pb.RestingPose(x_m=math.inf))},
        {"applied": pb.AppliedFrequencies(mean_hz=[math.nan])},
        {"conditions": pb.Conditions(battery_v=math.inf)},
        {"review": pb.Review(verdict="perhaps")},
        {"fit": pb.Fit(hyperparameters={"noise": math.nan})},
        {"steering": pb.SteeringStep(goal_x_m=math.nan)},
    ],
    ids=str,
)
def test_a_number_that_is_not_finite_or_an_unknown_word_in_a_trial_is_refused(change: dict[str, object]) -> None:
    suggestion = Suggestion(Gait((1.0,)), "initial design")
    decode_trial(pb.Trial(outcome="completed"), suggestion, (), (), ())
    with pytest.raises(ValueError, match=r"not a finite number|not plausible|is not a valid Verdict"):
        decode_trial(pb.Trial(**{"outcome": "completed", **change}), suggestion, (), (), ())


def test_the_log_says_what_made_it_to_any_mcap_program_and_after_a_recovery(tmp_path: Path) -> None:
    about = {"version": "0.2.0", "robot": "planar", "seed": "3", "date": "2026-11-28T08:00:00+00:00"}
    path = tmp_path / LOG_NAME
    RunLog.create(path, None, about=about).close()
    RunLog.recover(path)[0].close()

    with path.open("rb") as file:
        assert [record.metadata for record in make_reader(file).iter_metadata()] == [about]
    assert read_run(path).about == about


# Other programs.


def test_any_mcap_program_can_decode_every_message_from_the_schemas_in_the_file(tmp_path: Path) -> None:
    seen = {}
    with write(tmp_path / LOG_NAME).open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            pool = descriptor_pool.DescriptorPool()
            for each in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                pool.Add(each)
            kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
            seen[channel.topic] = kind.FromString(message.data)
    assert set(seen) == {
        "/run",
        "/optimizer/suggestion",
        "/robot/pose",
        "/robot/tracking",
        "/motors/command",
        "/motors/state",
        "/ground",
        "/robot/points",
        "/robot/scene",
        "/tf",
        "/trial",
    }
    assert seen["/trial"].outcome == "completed"
    assert seen["/robot/pose"].frame_id == "world"


def test_a_file_is_byte_for_byte_what_the_library_would_have_written() -> None:
    kinds = {"/run": pb.Run, "/trial": pb.Trial}
    chunks = [[(1, 70, b"run")], [(2, 90, b"a"), (1, 80, b""), (2, 80, b"long" * 99)], [(2, 95, b"last")]]
    ours, theirs = BytesIO(), BytesIO()

    writer = ChunkWriter(ours)
    for topic, kind in kinds.items():
        writer.register(topic, kind.DESCRIPTOR.full_name, describe(kind))
    writer.add_metadata("vvvaltr", {"version": "1", "robot": "planar"})
    for chunk in chunks:
        writer.write(Stamped(*message) for message in chunk)
    writer.finish()

    library = Writer(theirs, chunk_size=1 << 60, compression=CompressionType.NONE)
    library.start()
    for topic, kind in kinds.items():
        register(library, topic, kind)
    library.add_metadata("vvvaltr", {"version": "1", "robot": "planar"})
    for chunk in chunks:
        for channel, time_ns, payload in chunk:
            library.add_message(channel, time_ns, payload, time_ns)
        library.flush()
    library.finish()
    assert ours.getvalue() == theirs.getvalue()


def test_the_compiled_schema_is_that_of_the_proto_file() -> None:
    text = Path(pb.__file__).with_name("vvvaltr.proto").read_text()
    written = {
        (message, name, int(number))
        for message, body in re.findall(r"^message (\w+) {(.*?)^}", text, re.DOTALL | re.MULTILINE)
        for name, number in re.findall(r"(\w+) = (\d+);", body)
    }
    compiled = {
        (message.name, field.name, field.number)
        for message in pb.DESCRIPTOR.message_types_by_name.values()
        for field in message.fields
    }
    assert written == compiled


angles = st.floats(-3.0, 3.0)


@given(angles, angles, angles)
def test_the_quaternion_turns_by_yaw_then_pitch_then_roll(yaw: float, pitch: float, roll: float) -> None:
    ours = codec.to_quaternion(Pose(0.0, (0.0, 0.0, 0.0), yaw, pitch, roll))
    reference = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    assert ours == pytest.approx(tuple(math.copysign(1.0, np.dot(ours, reference)) * reference))


def test_trials_that_ran_faster_than_real_time_do_not_overlap_in_the_log(tmp_path: Path) -> None:
    spans: list[tuple[int, int]] = []
    begin = 0
    with write(tmp_path / LOG_NAME).open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            if channel.topic == "/optimizer/suggestion":
                begin = message.log_time
            if channel.topic == "/trial":
                spans.append((begin, message.log_time))
    assert [end - begin for begin, end in spans] == [10**9] * 4
    assert all(second[0] >= first[1] for first, second in pairwise(spans))
    assert spans[0][0] == round(RUN.trials[0].trial.started_unix_s * 1e9)


# What is torn.


def test_a_log_cut_anywhere_gives_the_trials_before_the_cut(tmp_path: Path, finished: bytes) -> None:
    path = tmp_path / LOG_NAME
    whole = sample_run(trials=3, poses=3)
    counts = []
    for length in range(len(finished) - 1, 8, -53):
        path.write_bytes(finished[:length])
        try:
            run = read_run(path)
        except UserError as error:
            assert "holds no run" in str(error)
            continue
        assert run == replace(whole, trials=whole.trials[: len(run.trials)])
        counts.append(len(run.trials))
    assert sorted(set(counts)) == [0, 1, 2, 3]
    assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("cut", [1, 40, 1000])
def test_recovery_of_a_torn_log_goes_on_behind_its_last_complete_trial(tmp_path: Path, cut: int) -> None:
    path = tmp_path / LOG_NAME
    path.write_bytes(unfinished_log(tmp_path / "whole", RUN)[:-cut])
    log, run = RunLog.recover(path)
    with log:
        assert run == replace(RUN, trials=RUN.trials[: len(run.trials)])
        assert len(run.trials) >= 3
        log.append(logged_trial(9))
    assert read_run(path) == replace(run, trials=(*run.trials, logged_trial(9)))


def test_recovery_keeps_the_bytes_it_could_not_read(tmp_path: Path) -> None:
    path = tmp_path / LOG_NAME
    torn = unfinished_log(tmp_path / "whole", RUN)[:-1]
    path.write_bytes(torn)
    RunLog.recover(path)[0].close()
    assert (tmp_path / "trials.mcap.torn").read_bytes() == torn


def test_a_finished_log_can_be_continued_and_is_then_what_one_session_would_have_written(tmp_path: Path) -> None:
    path = write(tmp_path / LOG_NAME, replace(RUN, trials=RUN.trials[:2]))
    log, run = RunLog.recover(path)
    with log:
        for logged in RUN.trials[2:]:
            log.append(logged)
    assert run.trials == RUN.trials[:2]
    assert read_run(path) == RUN
    assert sorted(each.name for each in tmp_path.iterdir()) == [LOG_NAME]


def test_sigkill_loses_no_trial_that_was_appended(tmp_path: Path) -> None:
    program = (
        "import os, signal, pathlib, sys; sys.path.insert(0, 'tests/support');"
        "from sample_run import sample_run; from vvvaltr.controller.runs.log import RunLog; RUN = sample_run();"
        f"log = RunLog.create(pathlib.Path({str(tmp_path / LOG_NAME)!r}), RUN.structure, RUN.sources, RUN.about);"
        "[log.append(logged) for logged in RUN.trials];"
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parents[3], check=False)
    assert done.returncode == -signal.SIGKILL
    assert read_run(tmp_path) == RUN
    assert not (tmp_path / "trials.mcap.torn").exists()


# What is refused.


def test_an_existing_log_is_never_written_over(tmp_path: Path) -> None:
    path = write(tmp_path / LOG_NAME)
    with pytest.raises(FileExistsError):
        RunLog.create(path, None)
    assert read_run(path) == RUN


def test_a_log_that_is_being_written_cannot_be_recovered(tmp_path: Path) -> None:
    path = tmp_path / LOG_NAME
    with RunLog.create(path, None), pytest.raises(UserError, match="being written by another process"):
        RunLog.recover(path)


def test_of_two_that_recover_a_log_at_once_one_gets_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, others = write(tmp_path / LOG_NAME), []

    def lock_late(file: IO[bytes], at: Path) -> None:
        monkeypatch.undo()
        others.append(RunLog.recover(path)[0])
        lock(file, at)

    monkeypatch.setattr("vvvaltr.controller.runs.log.lock", lock_late)
    with pytest.raises(UserError, match="being written by another process"):
        RunLog.recover(path)

    with others[0] as log:
        assert log.is_at(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not an MCAP file"),
        (b"started,gait,score\n", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "holds no run"),
    ],
)
def test_a_file_that_holds_no_run_is_refused_by_name(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(content)
    with pytest.raises(UserError, match=f"other.mcap.*{message}.*: "):
        read_run(path)


def test_a_missing_run_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="nowhere: No such file"):
        read_run(tmp_path / "nowhere")


def register(writer: Writer, topic: str, kind: type[Message]) -> int:
    """Open a channel by the library."""
    schema = writer.register_schema(kind.DESCRIPTOR.full_name, SchemaEncoding.Protobuf, describe(kind))
    return writer.register_channel(topic, MessageEncoding.Protobuf, schema)


def foreign(path: Path, topic: str, message: object, compression: CompressionType = CompressionType.NONE) -> Path:
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        writer.add_message(register(writer, topic, type(message)), 0, message.SerializeToString(), 0)
        writer.finish()
    return path


def test_a_log_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    path = foreign(tmp_path / LOG_NAME, "/run", pb.Run(format=3))
    with pytest.raises(UserError, match="log format 3, but this version reads up to 2: upgrade"):
        read_run(path)


def test_a_log_of_another_program_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="holds no run"):
        read_run(foreign(tmp_path / LOG_NAME, "/odometry", pb.Tracking()))


def test_a_compressed_log_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    bomb = pb.Suggestion(origin="a" * 10**7)
    path = foreign(tmp_path / LOG_NAME, "/optimizer/suggestion", bomb, CompressionType.ZSTD)
    with pytest.raises(UserError, match="compressed"):
        read_run(path)


@pytest.mark.parametrize(
    "message",
    [
        pb.Trial(outcome="completed"),
        pb.Trial(outcome="vanished"),
        pb.Suggestion(gait=pb.Gait(frequency_hz=[float("nan")])),
        pb.Tracking(markers_m=[0.0, 1.0]),
        pb.Run(format=1, structure=pb.Structure(terrain=pb.Terrain(x_m=[0.0], y_m=[0.0]))),
        pb.Run(format=1, sources=[pb.Source(name="empty")]),
        *(
            pb.Run(sources=[pb.Source(name="wrong", gaits=[pb.Gait(frequency_hz=[1.0])], scores_m_s=[score_m_s])])
            for score_m_s in (math.nan, math.inf, 66.0)
        ),
        pb.Tracking(t_s=math.inf),
        pb.Command(t_s=math.nan),
        pb.MotorState(t_s=math.inf),
    ],
)
def test_a_message_that_no_run_writes_is_damage(tmp_path: Path, message: object) -> None:
    topics = {
        pb.Trial: "/trial",
        pb.Suggestion: "/optimizer/suggestion",
        pb.Tracking: "/robot/tracking",
        pb.Command: "/motors/command",
        pb.MotorState: "/motors/state",
        pb.Run: "/run",
    }
    with pytest.raises(UserError, match="is damaged"):
        read_run(foreign(tmp_path / LOG_NAME, topics[type(message)], message))


@given(st.data())
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_wrong_bytes_give_one_line_or_the_trials_before_them(
    tmp_path: Path, finished: bytes, data: st.DataObject
) -> None:
    path = tmp_path / LOG_NAME
    corrupt = bytearray(finished)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(8, len(corrupt) - 1))
        corrupt[at : at + data.draw(st.integers(0, 9))] = data.draw(st.binary(max_size=9))
    path.write_bytes(corrupt)
    whole = sample_run(trials=3, poses=3)
    try:
        run = read_run(path)
    except UserError as error:
        assert "\n" not in str(error)
    else:
        assert run == replace(whole, trials=whole.trials[: len(run.trials)])


def test_a_wrong_byte_in_a_trial_with_others_behind_it_is_damage_and_not_a_torn_end(tmp_path: Path) -> None:
    data = bytearray(unfinished_log(tmp_path / "whole", RUN))
    data[data.index(b"initial design")] ^= 1
    path = tmp_path / LOG_NAME
    path.write_bytes(data)
    with pytest.raises(UserError, match="is damaged"):
        RunLog.recover(path)
    assert path.read_bytes() == data


# A disk that fails.


@pytest.fixture
def small_disk() -> object:
    """Files cannot grow past 200 kB, as if the disk were full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.usefixtures("small_disk")
def test_a_full_disk_is_reported_as_it_is_and_loses_only_the_trial_in_progress(tmp_path: Path) -> None:
    path = tmp_path / LOG_NAME
    written = []
    with pytest.raises(OSError, match="File too large"), RunLog.create(path, STRUCTURE, (SOURCE,)) as log:
        for number in range(1, 100):
            log.append(logged_trial(number))
            written.append(logged_trial(number))
    assert len(written) > 3
    assert read_run(path).trials == tuple(written)


@pytest.mark.usefixtures("small_disk")
def test_recovery_on_a_full_disk_leaves_the_old_log_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / LOG_NAME
    with pytest.raises(OSError, match="File too large"), RunLog.create(path, STRUCTURE, (SOURCE,)) as log:
        for number in range(1, 100):
            log.append(logged_trial(number))
    data = path.read_bytes()
    resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
    with pytest.raises(OSError, match="File too large"):
        RunLog.recover(path)
    assert path.read_bytes() == data


def test_a_trial_that_cannot_be_written_down_leaves_the_log_as_it_was(tmp_path: Path) -> None:
    with RunLog.create(tmp_path / LOG_NAME, None) as log:
        log.append(logged_trial(1))
        with pytest.raises(ValueError, match="NaN"):
            log.append(
                replace(logged_trial(2), trial=replace(logged_trial(2).trial, states=(MotorState(math.nan, ()),)))
            )
        log.append(logged_trial(3))
    assert [logged.trial.number for logged in read_run(tmp_path).trials] == [1, 3]


def test_closing_twice_is_harmless_and_appending_afterwards_is_refused(tmp_path: Path) -> None:
    log = RunLog.create(tmp_path / LOG_NAME, None)
    log.close()
    log.close()
    with pytest.raises(ValueError, match="closed"):
        log.append(logged_trial(1))


def test_a_resumed_log_keeps_the_bytes_of_every_recording_without_holding_them_in_memory(tmp_path: Path) -> None:
    path, trials = tmp_path / "trials.mcap", tuple(logged_trial(number) for number in range(1, 8))
    with RunLog.create(path, STRUCTURE) as log:
        for logged in trials:
            log.append(logged)

    log, run = RunLog.recover(path, recordings=False)
    log.append(logged_trial(8))
    log.close()

    assert run.trials == tuple(logged.without_recordings() for logged in trials)
    assert not any(logged.trial.poses or logged.trial.states or logged.trial.commands for logged in run.trials)
    assert read_run(path).trials == (*trials, logged_trial(8))


def test_trials_are_read_one_by_one(tmp_path: Path) -> None:
    path, trials = tmp_path / "trials.mcap", [logged_trial(number) for number in range(1, 4)]
    RunLog.create(path, STRUCTURE, trials=trials).close()

    assert list(read_trials(path)) == trials
    assert list(read_run(path, recordings=False).trials) == [logged.without_recordings() for logged in trials]


def test_many_trials_share_chunks_and_one_sync(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced = []
    sync = NewFile.sync
    monkeypatch.setattr(NewFile, "sync", lambda disk: synced.append(disk.tell()) or sync(disk))  # type: ignore[func-returns-value]
    trials = [logged_trial(number, poses=2) for number in range(1, 101)]

    log = RunLog.create(tmp_path / "trials.mcap", STRUCTURE, trials=trials)

    assert len(synced) == 1
    log.close()
    assert len(list(read_trials(tmp_path / "trials.mcap"))) == 100


def test_a_log_that_was_killed_between_two_trials_is_whole(tmp_path: Path) -> None:
    path = tmp_path / LOG_NAME
    path.write_bytes(unfinished_log(tmp_path / "whole", RUN))

    RunLog.recover(path)[0].close()

    assert not path.with_name(f"{LOG_NAME}.torn").exists()


def test_a_length_beyond_the_file_takes_no_memory(tmp_path: Path, finished: bytes) -> None:
    path, chunk = tmp_path / LOG_NAME, finished.index(b"initial design")
    record = finished.rindex(b"\x06", 0, chunk)  # the chunk that holds it
    path.write_bytes(finished[: record + 1] + b"\xff" * 7 + finished[record + 8 :])

    with pytest.raises(UserError, match="is damaged"):
        read_run(path)
