"""Logs with right checksums and absurd contents, through every command that opens a log: one line, never a defect.

python -m benchmarks.fuzz_logs --json
"""

from __future__ import annotations

import contextlib
import copy
import io
import json
import math
import random
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import Message

from benchmarks.figures import make_parser
from vvvaltr.controller.cli.main import main as vvvaltr
from vvvaltr.controller.runs.log import _KINDS, LOG_NAME
from vvvaltr.controller.runs.schema.mcap_file import describe, read_entries
from vvvaltr.controller.runs.schema.mcap_writer import ChunkWriter, Stamped

Entries = list[tuple[str, Message]]

_NUMBERS = (math.nan, math.inf, 1e308, -1e12, 0.0, -1.0)
_TEXTS = ("", "nonsense", "\x1b[2J\u202e", "x" * 200_000)
_MANY = 100_000
_SLOW_S, _HUNG_S, _MOST_MB = 10.0, 120.0, 300.0  # of the processor, by the clock, and of memory at most


def make_run(folder: Path) -> Path:
    """Return a new run of three trials, with a source."""
    learn = ["learn", "--duration", "0.3", "--no-recording", "--quiet", "--world", "hills"]
    with contextlib.redirect_stdout(io.StringIO()):
        assert vvvaltr([*learn, "--trials", "2", "--out", str(folder / "source")]) == 0
        run = folder / "run"
        assert vvvaltr([*learn, "--trials", "3", "--source", str(folder / "source"), "--out", str(run)]) == 0
    return run


def read(log: Path) -> Entries:
    """Return the messages of a log."""
    with log.open("rb") as file:
        return [(topic, _KINDS[topic].FromString(payload)) for topic, _, payload in read_entries(file)]


def write(entries: Entries, log: Path) -> None:
    """Write messages as a run does, a chunk a trial."""
    with log.open("wb") as file:
        writer = ChunkWriter(file)
        channels = {
            topic: writer.register(topic, kind.DESCRIPTOR.full_name, describe(kind)) for topic, kind in _KINDS.items()
        }
        together: list[Stamped] = []
        for topic, message in entries:
            together.append(Stamped(channels[topic], 0, message.SerializeToString()))
            if topic in ("/run", "/trial"):
                writer.write(together)
                together = []
        writer.finish()


def places(message: Message, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield where in a message a field can be changed."""
    for field in message.DESCRIPTOR.fields:
        yield (*path, field.name)
        if field.message_type is None or field.message_type.GetOptions().map_entry:
            continue
        if not field.is_repeated and message.HasField(field.name):
            yield from places(getattr(message, field.name), (*path, field.name))
        elif field.is_repeated and len(getattr(message, field.name)):
            yield from places(getattr(message, field.name)[0], (*path, field.name, 0))


def spoil(message: Message, path: Sequence[Any], dice: random.Random) -> None:
    """Change one field of a message into something absurd."""
    *way, name = path
    for step in way:
        message = message[step] if isinstance(step, int) else getattr(message, step)  # type: ignore[index]
    field = message.DESCRIPTOR.fields_by_name[name]
    if field.message_type is not None and field.message_type.GetOptions().map_entry:
        key = dice.choice(_TEXTS)
        is_text = field.message_type.fields_by_name["value"].type == FieldDescriptor.TYPE_STRING
        getattr(message, name)[key] = dice.choice(_TEXTS) if is_text else dice.choice(_NUMBERS)
    elif field.message_type is not None:
        if field.is_repeated and dice.random() < 0.5:
            for _ in range(dice.choice((1, _MANY))):
                getattr(message, name).add()
        else:
            message.ClearField(name)
    elif field.is_repeated:
        values = getattr(message, name)
        match dice.randrange(3):
            case 0:
                del values[:]
            case 1:
                values.extend([_absurd(field, dice)] * _MANY)
            case _:
                values.append(_absurd(field, dice))
    else:
        setattr(message, name, _absurd(field, dice))


def _absurd(field: Any, dice: random.Random) -> Any:
    match field.cpp_type:
        case FieldDescriptor.CPPTYPE_DOUBLE:
            return dice.choice(_NUMBERS)
        case FieldDescriptor.CPPTYPE_STRING:
            return b"x" * 1000 if field.type == FieldDescriptor.TYPE_BYTES else dice.choice(_TEXTS)
        case FieldDescriptor.CPPTYPE_BOOL:
            return dice.random() < 0.5
        case FieldDescriptor.CPPTYPE_INT64:
            return dice.choice((0, -(2**63), 2**63 - 1))
        case FieldDescriptor.CPPTYPE_INT32 | FieldDescriptor.CPPTYPE_ENUM:
            return dice.choice((0, -1, 2**31 - 1))
    return dice.choice((0, 2**32 - 1))


def try_apart(run: Path, scratch: Path) -> list[str]:
    """Return what is wrong with the answers, in a process of their own.

    Rerun keeps some kB of each call that ever sent something to a recording: a view has hundreds.
    """
    context = get_context("fork")  # with what has been imported
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=lambda: theirs.send(list(try_commands(run, scratch))))
    process.start()
    theirs.close()
    try:
        return ours.recv() if ours.poll(4 * _HUNG_S) else ["hung"]
    except EOFError:
        process.join()
        return [f"the process died with status {process.exitcode}"]
    finally:
        process.kill()
        process.join()
        ours.close()


def try_commands(run: Path, scratch: Path) -> Iterator[str]:
    """Open a spoilt run by each command; yield what is wrong with the answers."""
    commands = {
        "export": ["export", str(run), "--csv", str(scratch / "table.csv")],
        "view": ["view", str(run), "--save", str(scratch / "view.rrd")],
        "source": ["learn", "--source", str(run), "--trials", "1", "--duration", "0.2", "--no-recording", "--quiet",
                   "--out", str(scratch / "learned")],
        "resume": ["learn", "--resume", str(run), "--trials", "4", "--no-recording", "--quiet"],
    }  # fmt: skip
    for name, command in commands.items():
        out, told, begin_s, work_s = io.StringIO(), io.StringIO(), time.perf_counter(), time.process_time()
        _forget_peak()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(told):
            try:
                status = vvvaltr(command)
            except SystemExit as end:
                status = int(end.code or 0)
        took_s, worked_s, peak_mb = time.perf_counter() - begin_s, time.process_time() - work_s, _peak_mb()
        lines = told.getvalue()
        if status not in (0, 1, 2) or "defect" in lines or "Traceback" in lines or len(lines.splitlines()) > 1:
            yield f"{name}: status {status}: {lines[-400:]}"
        if "\x1b" in lines + out.getvalue():
            yield f"{name}: a control character on the terminal"
        if worked_s > _SLOW_S or took_s > _HUNG_S:
            yield f"{name}: {worked_s:.1f} s of processor, {took_s:.1f} s"
        if peak_mb > _MOST_MB:
            yield f"{name}: {peak_mb:.0f} MB"


def _forget_peak() -> None:
    """Let the greatest memory of this process be counted anew."""
    Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    """Return the greatest memory of this process since then, in MB."""
    line = next(it for it in Path("/proc/self/status").read_text().splitlines() if it.startswith("VmHWM:"))
    return int(line.split()[1]) * 1024 / 1e6


def campaign(count: int, seed: int) -> list[str]:
    """Spoil ``count`` logs, one field each; return what was wrong."""
    dice = random.Random(seed)
    complaints = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run = make_run(folder)
        entries = read(run / LOG_NAME)
        for number in range(count):
            spoilt = copy.deepcopy(entries)
            topic = dice.choice([kind for kind in _KINDS if any(kind == each for each, _ in entries)])
            message = dice.choice([message for each, message in spoilt if each == topic])
            path = dice.choice(list(places(message)))
            spoil(message, path, dice)
            scratch = folder / str(number)
            shutil.copytree(run, scratch / "spoilt")
            write(spoilt, scratch / "spoilt" / LOG_NAME)
            where = f"{topic} {'.'.join(map(str, path))}"
            complaints += [f"{number}: {where}: {it}" for it in try_apart(scratch / "spoilt", scratch)]
            shutil.rmtree(scratch)
    return complaints


def main() -> None:
    """Run the command line."""
    parser = make_parser(__doc__)
    parser.add_argument("--count", type=int, default=500, help="number of spoilt logs")
    parser.add_argument("--seed", type=int, default=0, help="seed of what is spoilt")
    arguments = parser.parse_args()
    complaints = campaign(arguments.count, arguments.seed)
    if arguments.json:
        print(json.dumps({"logs": arguments.count, "wrong": len(complaints), "examples": complaints[:5]}))
    else:
        print(f"{arguments.count} logs, {len(complaints)} wrong", *complaints, sep="\n")


if __name__ == "__main__":
    main()
