"""`vvvaltr learn`: what it tells and leaves, what it refuses, and how an ended run goes on."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import pytest
from calling import call

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.runs.log import read_run

VVVALTR = (sys.executable, "-c", "import sys; from vvvaltr.controller.cli.main import main; sys.exit(main())")
QUICK = ("--duration", "0.5", "--seed", "1")


def learn(run: Path, *more: str) -> list[str]:
    return ["learn", "--robot", "planar", *QUICK, "--no-recording", "--out", str(run), *more]


@pytest.fixture(scope="module")
def flat(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("runs") / "flat"
    assert main(learn(run, "--trials", "10")) == 0
    return run


def test_learn_ends_with_one_json_object_that_is_also_the_summary(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(learn(tmp_path / "run", "--trials", "9", "--json"), capsys)

    found = json.loads(out)
    assert status == 0
    assert found == json.loads((tmp_path / "run" / "summary.json").read_text())
    assert found["run"] == str(tmp_path / "run")
    assert (found["robot"], found["method"], found["trials"]) == ("planar", "drive", 9)
    assert found["outcomes"] == {"completed": 9}
    assert set(found["best_observed"]) == {"trial", "gait_hz", "score_m_s"}
    assert set(found["recommended"]) == {"gait_hz", "mean_m_s", "low_m_s", "high_m_s"}
    assert "trial 9, 9 of 9" in err


def test_learn_tells_people_the_belief_with_its_interval_and_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, out, _ = call(learn(tmp_path / "run", "--trials", "9"), capsys)

    assert "posterior mean" in out
    assert "95 % interval" in out
    assert str(tmp_path / "run") in out


def test_a_source_makes_it_a_transfer(flat: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "hills"

    status, out, _ = call(learn(run, "--world", "hills", "--source", str(flat), "--trials", "3", "--json"), capsys)

    assert status == 0
    assert json.loads(out)["method"] != "plain"
    assert [len(source.gaits) for source in read_run(run / "trials.mcap").sources] == [10]


def test_the_same_seed_gives_the_same_run(flat: Path, tmp_path: Path) -> None:
    main(learn(tmp_path / "again", "--trials", "10"))

    assert trials(tmp_path / "again") == trials(flat)


def trials(run: Path) -> list[tuple[object, ...]]:
    logged = read_run(run / "trials.mcap").trials
    return [(it.suggestion, it.trial.gait, it.trial.poses, it.trial.states, it.score) for it in logged]


def test_phases_can_be_searched(tmp_path: Path) -> None:
    status = main(learn(tmp_path / "run", "--optimise", "frequency,phase", "--trials", "9"))

    gaits = [logged.trial.gait for logged in read_run(tmp_path / "run" / "trials.mcap").trials]
    assert status == 0
    assert len({gait.phase_rad for gait in gaits}) == 9


def test_an_existing_run_is_never_overwritten(flat: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (flat / "trials.mcap").read_bytes()

    status, _, err = call(learn(flat), capsys)

    assert status == 1
    assert f"{flat} exists" in err
    assert (flat / "trials.mcap").read_bytes() == before


def test_an_out_that_cannot_be_made_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("in the way")

    status, _, err = call(learn(tmp_path / "file" / "run"), capsys)

    assert status == 1
    assert "file" in err


def test_a_source_with_another_number_of_motors_is_refused(
    flat: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from vvvaltr.controller.core.gaits import Gait
    from vvvaltr.controller.core.records import LoggedTrial
    from vvvaltr.controller.core.values import Outcome, Pose, Suggestion, Trial
    from vvvaltr.controller.runs.log import RunLog

    gait = Gait((12.0, 12.0))
    poses = (Pose(0.0, (0.0, 0.0, 0.0)), Pose(1.0, (0.1, 0.0, 0.0)))
    with RunLog.create(tmp_path / "two.mcap", None) as log:
        trial = Trial(1, gait, Outcome.COMPLETED, "", 0.0, 1.0, poses)
        log.append(LoggedTrial(Suggestion(gait, "by hand"), trial, 0.1, None))

    status, _, err = call(learn(tmp_path / "run", "--source", str(tmp_path / "two.mcap")), capsys)

    assert status == 2
    assert "two.mcap is of 2 motors, the robot has 3" in err
    assert not (tmp_path / "run").exists()


def test_a_resumed_run_must_be_asked_for_the_same(flat: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for more, difference in (
        (["--seed", "2"], "seed: the run has 1, but 2 was asked for"),
        (["--world", "hills"], "world: the run has flat, but hills was asked for"),
        (["--duration", "3"], "--duration: the run has 0.5, but 3.0 was asked for"),
        (["--trials", "5"], "trials: the run has 10, but 5 was asked for"),
    ):
        status, _, err = call(["learn", "--resume", str(flat), *more], capsys)
        assert status == 1
        assert difference in err


def test_a_finished_run_can_be_prolonged(flat: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    short = tmp_path / "short"
    main(learn(short, "--trials", "6"))

    status, _, _ = call(["learn", "--resume", str(short), "--trials", "10", "--no-recording"], capsys)

    assert status == 0
    assert trials(short) == trials(flat)


def test_the_last_trials_confirm_the_most_promising_gaits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = tmp_path / "run"

    status, out, _ = call(learn(run, "--trials", "15", "--confirm", "2x3", "--json"), capsys)

    logged = read_run(run / "trials.mcap").trials
    repeated = [it.trial.gait for it in logged if it.suggestion.origin == "confirmation"]
    assert status == 0
    assert [it.suggestion.origin == "confirmation" for it in logged] == [False] * 9 + [True] * 6
    assert repeated == repeated[:2] * 3
    assert json.loads(out)["recommended"]["gait_hz"] in [list(gait.frequency_hz) for gait in repeated]


def test_a_search_without_prospects_ends_before_its_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(learn(tmp_path / "run", "--trials", "100", "--stop-when", "50", "--json"), capsys)

    assert status == 0
    assert json.loads(out)["trials"] < 20


def test_a_learning_run_leaves_a_recording_where_rerun_is_installed(tmp_path: Path) -> None:
    run = tmp_path / "run"

    assert main(["learn", *QUICK, "--trials", "3", "--out", str(run)]) == 0

    assert subprocess.run([sys.executable, "-m", "rerun", "rrd", "verify", str(run / "run.rrd")], check=True)


def start(arguments: Sequence[str]) -> subprocess.Popen[str]:
    return subprocess.Popen([*VVVALTR, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_trials(run: Path, bytes_at_least: int) -> None:
    log = run / "trials.mcap"
    deadline_s = time.monotonic() + 30.0
    while not (log.exists() and log.stat().st_size > bytes_at_least):
        assert time.monotonic() < deadline_s, "the run does not begin"
        time.sleep(0.005)


def killed_run(folder: Path, bytes_at_least: int) -> Path:
    """Kill a run of ten trials; on a busy computer it may have ended before, and another one is begun."""
    for number in range(20):
        run = folder / f"run{number}"
        process = start(learn(run, "--trials", "10"))
        wait_for_trials(run, bytes_at_least)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        if process.returncode == -signal.SIGKILL:
            return run
    raise AssertionError("no run was killed before its end")


@pytest.mark.parametrize("moment", [1_000, 60_000, 90_000])
def test_a_killed_run_resumes_as_if_nothing_had_happened(flat: Path, tmp_path: Path, moment: int) -> None:
    run = killed_run(tmp_path, moment)

    assert main(["learn", "--resume", str(run), "--no-recording"]) == 0

    assert trials(run) == trials(flat)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_says_how_to_go_on(tmp_path: Path, number: signal.Signals) -> None:
    run = tmp_path / "run"
    process = start([*learn(run, "--trials", "5000")])
    wait_for_trials(run, 60_000)

    process.send_signal(number)
    out, err = process.communicate(timeout=20)

    assert process.returncode == 130
    assert out == ""
    assert (
        err.splitlines()[-1] == f"vvvaltr: interrupted ({number.name}; the run is saved, continue it by --resume {run})"
    )
    assert json.loads((run / "summary.json").read_text())["outcomes"]["completed"] >= 1


def test_learning_on_the_lean_install_imports_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys, importlib.util as u; from vvvaltr.controller.cli.main import main\n"
        "find = u.find_spec\n"
        "u.find_spec = lambda name, *more: None if name == 'rerun' else find(name, *more)\n"
        f"main({learn(tmp_path / 'run', '--trials', '9')!r})\n"
        "heavy = {'scipy', 'rerun', 'mujoco', 'matplotlib', 'cv2', 'can', 'serial'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )

    subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, env={**os.environ, "TQDM_DISABLE": "1"}
    )
