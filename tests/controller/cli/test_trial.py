"""`vvvaltr trial`: one gait, once or several times, kept as a run where that is asked for."""

import json
from pathlib import Path

import pytest
from calling import call

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.errors import LinkLost
from vvvaltr.controller.core.values import Phase
from vvvaltr.controller.runs.log import read_run
from vvvaltr.drivers.mocking.process import MockProcess
from vvvaltr.twin.robot import TwinMotors

GAIT = ("trial", "12", "-14", "9", "--robot", "planar", "--duration", "0.5", "--seed", "1")


def test_repeats_give_each_score_and_the_mean_with_its_interval(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*GAIT, "--repeats", "4", "--json"]) == 0

    found = json.loads(capsys.readouterr().out)
    scores = [repeat["score_m_s"] for repeat in found["repeats"]]
    assert (found["outcome"], found["reason"], len(set(scores))) == ("completed", "", 4)
    assert found["mean_m_s"] == pytest.approx(sum(scores) / 4)
    assert found["low_m_s"] < found["mean_m_s"] < found["high_m_s"]


def test_the_first_repeat_is_the_trial_without_repeats(capsys: pytest.CaptureFixture[str]) -> None:
    main([*GAIT, "--json"])
    once = json.loads(capsys.readouterr().out)
    main([*GAIT, "--repeats", "2", "--json"])
    twice = json.loads(capsys.readouterr().out)

    assert twice["repeats"][0]["score_m_s"] == once["score_m_s"]


def test_what_was_measured_is_kept_as_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "tried"

    assert main([*GAIT, "--repeats", "3", "--out", str(out), "--json"]) == 0

    found = json.loads(capsys.readouterr().out)
    trials = read_run(out).trials
    assert found["run"] == str(out)
    assert [it.score for it in trials] == [repeat["score_m_s"] for repeat in found["repeats"]]
    assert read_run(out).about["robot"] == "planar"
    assert {it.suggestion.origin for it in trials} == {"asked for"}
    assert {it.suggestion.phase for it in trials} == {Phase.ASKED}
    assert all(it.movement is not None and it.applied is not None for it in trials)
    assert all(it.trial.poses and it.trial.commands and it.trial.states for it in trials)
    assert json.loads((out / "summary.json").read_text())["outcomes"] == {"completed": 3}


def test_what_was_kept_can_be_viewed_and_learned_from(tmp_path: Path) -> None:
    out = tmp_path / "tried"
    main([*GAIT, "--repeats", "2", "--out", str(out)])

    assert main(["view", str(out), "--save", str(tmp_path / "tried.rrd")]) == 0
    learn = ["learn", "--source", str(out), "--trials", "2", "--duration", "0.5", "--no-recording"]
    assert main([*learn, "--out", str(tmp_path / "run")]) == 0
    assert len(read_run(tmp_path / "run").sources[0].scores) == 2


def test_an_existing_directory_is_never_written_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mine").mkdir()

    assert main([*GAIT, "--out", str(tmp_path / "mine")]) == 1

    assert "mine exists: choose another --out" in capsys.readouterr().err
    assert list((tmp_path / "mine").iterdir()) == []


def test_a_robot_that_fails_three_times_ends_the_repeats_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def unplugged(*_: object) -> None:
        raise LinkLost("the port is gone")

    monkeypatch.setattr(TwinMotors, "drive", unplugged)

    assert main([*GAIT, "--repeats", "9", "--out", str(tmp_path / "tried"), "--json"]) == 1

    found = json.loads(capsys.readouterr().out)
    assert (found["outcome"], found["reason"], found["mean_m_s"]) == ("link_lost", "the port is gone", None)
    assert [repeat["score_m_s"] for repeat in found["repeats"]] == [None] * 3
    assert len(read_run(tmp_path / "tried").trials) == 3


def test_people_are_told_the_mean_with_its_interval_and_where_the_trials_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main([*GAIT, "--repeats", "3", "--out", str(tmp_path / "tried")])

    out = capsys.readouterr().out
    assert "trial 3: completed" in out
    assert "95 % interval" in out
    assert f"vvvaltr view {tmp_path / 'tried'}" in out


def test_trial_reports_one_trial(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call([*GAIT, "--json"], capsys)

    found = json.loads(out)
    assert status == 0
    assert set(found) == {"outcome", "reason", "score_m_s", "is_within_error", "gait_hz", "duration_s"}
    assert (found["outcome"], found["gait_hz"], found["duration_s"]) == ("completed", [12.0, -14.0, 9.0], 0.5)


@pytest.mark.parametrize(
    ("more", "complaint"),
    [
        (("--phase", "1", "0", "0"), "--phase: the motors of"),
        (("--amplitude", "0.5", "1", "1"), "--amplitude: the motors of"),
    ],
    ids=lambda value: value[0] if isinstance(value, tuple) else "",
)
def test_what_the_motors_cannot_set_is_bad_input(
    odrive: MockProcess, more: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, err = call(["trial", "5", "5", "5", "--robot", odrive.greeting.robot_file, *more], capsys)

    assert (status, out) == (2, "")
    assert err.startswith(f"vvvaltr: {complaint} {odrive.greeting.robot_file} cannot set it")
    assert len(err.splitlines()) == 1
