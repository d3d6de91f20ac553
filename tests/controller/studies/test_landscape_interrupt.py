"""A landscape ends when it is told to, and refuses what it cannot write before it begins."""

import errno
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.studies import landscape

PLANAR = ["landscape", "--robot", "planar", "--repeats", "1"]
LONG = [*PLANAR, "--grid", "9", "--duration", "2000"]
PROGRAM = [sys.executable, "-c", "from vvvaltr.entry import main; main()"]


def workers_of(parent: int) -> list[int]:
    """Return the processes that ``parent`` began, once they run: the tracker of shared resources, and two workers."""
    for _ in range(200):
        found = [int(pid) for pid in Path(f"/proc/{parent}/task/{parent}/children").read_text().split()]
        if len(found) == 3 and all("spawn_main" in _command(pid) for pid in found[1:]):
            return found
        time.sleep(0.05)
    raise AssertionError("no workers")


def _command(pid: int) -> str:
    return Path(f"/proc/{pid}/cmdline").read_text()


def await_end(pids: list[int]) -> None:
    for _ in range(100):
        if not any(is_running(pid) for pid in pids):
            return
        time.sleep(0.05)
    raise AssertionError("processes stay")


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.parametrize(("number", "status"), [(signal.SIGTERM, 130), (signal.SIGKILL, -signal.SIGKILL)])
def test_no_worker_outlives_a_landscape_that_is_ended(tmp_path: Path, number: signal.Signals, status: int) -> None:
    command = [*PROGRAM, *LONG, "--jobs", "2", "--out", str(tmp_path / "l.png")]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as program:
        workers = workers_of(program.pid)
        program.send_signal(number)
        try:
            assert program.wait(timeout=30) == status
            await_end(workers)
        finally:
            program.kill()
            for pid in filter(is_running, workers):
                os.kill(pid, signal.SIGKILL)


def test_an_interrupted_trial_ends_the_landscape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from vvvaltr.twin.robot import TwinRobot

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt("SIGINT")

    monkeypatch.setattr(TwinRobot, "place", interrupted)

    assert main([*LONG, "--jobs", "1", "--out", str(tmp_path / "l.png")]) == 130
    assert "interrupted (SIGINT)" in capsys.readouterr().err


def test_a_place_that_takes_no_file_is_refused_before_the_first_trial(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delattr(landscape, "measure")

    assert main([*LONG, "--out", "/proc/l.png"]) == 1
    assert "--out /proc/l.png cannot be written" in capsys.readouterr().err


def test_a_full_disk_at_the_end_names_the_picture_and_the_cure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "l.png"

    def full(_panels: object, _title: str, path: Path) -> None:
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(landscape, "draw", full)

    assert main([*PLANAR, "--grid", "2", "--duration", "0.2", "--jobs", "1", "--out", str(out)]) == 1
    assert f"--out {out} cannot be written: No space left on device; free some space" in capsys.readouterr().err
    assert not out.exists()


def test_a_disk_that_is_full_at_the_end_does_not_lose_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, draw = tmp_path / "l.png", landscape.draw
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def full(panels: tuple[landscape.Panel, ...], title: str, path: Path) -> None:
        if path == out:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        draw(panels, title, path)

    monkeypatch.setattr(landscape, "draw", full)

    assert main([*PLANAR, "--grid", "2", "--duration", "0.2", "--jobs", "1", "--out", str(out)]) == 1
    (kept,) = tmp_path.glob("vvvaltr-*/l.png")
    assert f"--out {out} cannot be written: No space left on device; the picture is kept as {kept}" in (
        capsys.readouterr().err
    )
    assert kept.read_bytes().startswith(b"\x89PNG")
