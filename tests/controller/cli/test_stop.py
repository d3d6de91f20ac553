"""`stop`: from another terminal, a run's motors come to rest and the run is saved."""

import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs import underway
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.underway import find_all
from vvvaltr.drivers.mocking.process import MockProcess

PROGRAM = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")


def test_a_run_is_stopped_from_another_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    with MockProcess("node", tmp_path / "port") as mock:
        command = [*PROGRAM, "learn", "--robot", mock.greeting.robot_file, "--duration", "30", "--out", str(out)]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as run:
            mock.wait_until(lambda it: not it.is_at_rest, 60.0)
            assert str(out) in {each.what for each in find_all()}

            assert main(["stop", str(out)]) == 0

            assert mock.wait_until(lambda it: it.is_at_rest)
            _, told = run.communicate(timeout=30)
    assert run.returncode == 130
    assert f"the run is saved, continue it by --resume {out}" in told
    assert [logged.trial.outcome.value for logged in read_run(out).trials] == ["interrupted"]
    assert str(out) in capsys.readouterr().out
    assert main(["stop", str(out)]) == 1
    assert f"{out} is not under way on this machine" in capsys.readouterr().err


@pytest.mark.flaky(reruns=2)  # in real time
def test_all_runs_of_the_machine_are_stopped_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    devices, outs = ("node", "qik"), [tmp_path / "run-node", tmp_path / "run-qik"]
    with ExitStack() as stack:
        mocks = [stack.enter_context(MockProcess(device, tmp_path / device)) for device in devices]
        runs = []
        for mock, out in zip(mocks, outs, strict=True):
            command = [*PROGRAM, "learn", "--robot", mock.greeting.robot_file, "--duration", "30", "--out", str(out)]
            runs.append(subprocess.Popen(command, stdin=subprocess.DEVNULL))
            stack.enter_context(runs[-1])
            stack.callback(runs[-1].kill)
        for mock in mocks:
            mock.wait_until(lambda it: not it.is_at_rest, 60.0)
        monkeypatch.setattr(underway, "_PROC", a_machine_with(runs, tmp_path / "proc"))

        assert main(["stop"]) == 0

        for mock in mocks:
            assert mock.wait_until(lambda it: it.is_at_rest)
        assert [run.wait(timeout=30) for run in runs] == [130, 130]
    assert [[logged.trial.outcome.value for logged in read_run(out).trials] for out in outs] == [["interrupted"]] * 2
    told = capsys.readouterr().out
    assert all(f"stopped    {out}: motors at rest, all is saved" in told for out in outs)
    assert main(["stop"]) == 0
    assert capsys.readouterr().out == "nothing is under way on this machine\n"


def a_machine_with(processes: Sequence[subprocess.Popen[bytes]], folder: Path) -> Path:
    """Return what stands for /proc where these processes alone are, so that nothing else of this machine is stopped."""
    folder.mkdir()
    for process in processes:
        (folder / str(process.pid)).symlink_to(Path("/proc") / str(process.pid))
    return folder


def test_a_run_that_does_not_exist_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stop", str(tmp_path / "nothing")]) == 1

    assert capsys.readouterr().err == (
        f"vvvaltr: {tmp_path}/nothing: No such file or directory; name the directory of a run\n"
    )


@pytest.mark.parametrize("command", ["calibrate", "compare"])
def test_a_command_that_turns_motors_without_a_log_is_found(tmp_path: Path, command: str) -> None:
    program = tmp_path / "vvvaltr"
    program.write_text("import sys; sys.stdin.read()")
    with subprocess.Popen([sys.executable, str(program), command, "qik0.toml"], stdin=subprocess.PIPE) as process:
        found = {each.process: each.what for each in find_all()}
        assert process.stdin is not None
        process.stdin.close()

    assert found[process.pid] == f"vvvaltr {command}"
