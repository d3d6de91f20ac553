"""`repertoire` and `go` as their users rely on them."""

import json
from collections.abc import Sequence
from pathlib import Path

import calling
import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.core.records import LoggedTrial
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.controller.view.recording import LiveView


def call(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    """Return exit status, standard output and standard error of a command."""
    return calling.call(arguments, capsys)


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("runs") / "moves"
    assert main(["repertoire", "--robot", "spatial", "--gaits", "24", "--duration", "3", "--out", str(run)]) == 0
    return run


@pytest.fixture(scope="module")
def planar_moves(tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = tmp_path_factory.mktemp("runs") / "planar"
    assert main(["repertoire", "--robot", "planar", "--gaits", "16", "--duration", "2", "--out", str(run)]) == 0
    return run


def go(moves: Path, out: Path, *more: str) -> Sequence[str]:
    return ["go", *more, "--robot", "spatial", "--seed", "2", "--repertoire", str(moves), "--out", str(out), "--json"]


def test_a_repertoire_says_what_it_can_do(moves: Path) -> None:
    found = json.loads((moves / "summary.json").read_text())

    assert found["trials"] == 24
    assert len(found["movements"]) == found["gaits"] < 24  # good ones were repeated
    assert found["turn_left_rad_s"] > 0.02
    assert found["turn_right_rad_s"] > 0.02
    assert {"gait_hz", "forward_m_s", "left_m_s", "turn_rad_s", "sd", "scatter", "trials"} == set(found["movements"][0])


def test_a_repertoire_is_drawn(moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture, out = tmp_path / "moves.svg", tmp_path / "all"

    status, _, _ = call(capsys, "repertoire", "--from", str(moves), "--out", str(out), "--picture", str(picture))

    assert status == 0
    assert picture.read_text().count("<path") > 20


def test_a_repertoire_goes_on_as_it_would_have_gone_on(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    at_once, in_two = tmp_path / "at_once", tmp_path / "in_two"
    begin = ("repertoire", "--robot", "planar", "--duration", "2", "--seed", "3")
    call(capsys, *begin, "--gaits", "12", "--out", str(at_once))
    call(capsys, *begin, "--gaits", "7", "--out", str(in_two))

    status, _, _ = call(capsys, "repertoire", "--resume", str(in_two), "--gaits", "12")

    assert status == 0
    assert gaits_of(in_two) == gaits_of(at_once)


def test_trials_too_short_to_show_a_movement_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, _, err = call(capsys, "repertoire", "--robot", "planar", "--duration", "1", "--out", str(tmp_path / "m"))

    assert status == 2
    assert "--duration 1 is too short" in err
    assert not (tmp_path / "m").exists()


def gaits_of(run: Path) -> list[tuple[float, ...]]:
    return [logged.trial.gait.frequency_hz for logged in read_run(run).trials]


def test_go_reaches_a_place_and_says_how(moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = (moves / LOG_NAME).read_bytes()

    status, out, err = call(capsys, *go(moves, tmp_path / "g", "0.15", "-0.1"))

    found = json.loads(out)
    trials = read_run(tmp_path / "g").trials
    assert (status, found["reached"], found["reason"]) == (0, True, "")
    assert found["error_m"] <= 0.02
    assert found["position_m"] == pytest.approx([0.15, -0.1], abs=0.02)
    assert found["primitives"] == len(trials)
    assert found["duration_s"] == pytest.approx(sum(logged.trial.duration_s for logged in trials))
    assert found == json.loads((tmp_path / "g" / "summary.json").read_text())
    assert trials[0].steering is not None
    assert (moves / LOG_NAME).read_bytes() == before
    assert "\r" not in err


def test_what_go_learned_is_a_repertoire_too(moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, *go(moves, tmp_path / "first", "0.1", "0"))

    status, out, _ = call(capsys, *go(tmp_path / "first", tmp_path / "second", "0", "0.1"))
    assert (status, json.loads(out)["reached"]) == (0, True)

    sources = ("--from", str(moves), "--from", str(tmp_path / "first"))
    status, out, _ = call(capsys, "repertoire", *sources, "--out", str(tmp_path / "all"), "--json")
    assert status == 0
    assert json.loads(out)["trials"] == 24 + sum(is_seen(logged) for logged in read_run(tmp_path / "first").trials)


def is_seen(logged: LoggedTrial) -> bool:
    """Whether a primitive was driven for long enough to say something."""
    return logged.trial.outcome.is_valid and logged.trial.duration_s >= 1.7


def test_way_points_are_passed(moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "corner.csv").write_text("x,y\n0.06,0\n0.06,0.06\n")

    status, out, _ = call(capsys, *go(moves, tmp_path / "g", "--path", str(tmp_path / "corner.csv")))

    assert (status, json.loads(out)["goals"]) == (0, 2)


def test_a_program_follows_each_primitive_of_go(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, _, _ = call(capsys, *go(moves, tmp_path / "g", "0.1", "0", "--events", str(tmp_path / "events")))

    begin, *primitives, end = (json.loads(line) for line in (tmp_path / "events").read_text().splitlines())
    logged = read_run(tmp_path / "g").trials
    assert (status, begin["event"], end) == (0, "begin", {"event": "end", "text": "complete"})
    assert [line["trial"] for line in primitives] == [each.trial.number for each in logged]
    assert primitives[0]["steering"]["goal_m"] == [0.1, 0.0]
    assert primitives[0]["steering"]["predicted"]["forward_m"] == logged[0].steering.predicted.forward_m
    assert primitives[0]["steering"]["planned_hz"][0] == list(logged[0].trial.gait.frequency_hz)


def test_why_go_ended_short_of_its_goal_is_its_last_event(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call(capsys, *go(moves, tmp_path / "g", "-0.03", "0.01", "--time", "1", "--events", str(tmp_path / "events")))

    last = json.loads((tmp_path / "events").read_text().splitlines()[-1])
    assert last["event"] == "end"
    assert last["text"].startswith("not reached: not there after 1 s of driving")


def test_go_shown_live_moves_exactly_as_it_does_unseen(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    shown, frames = [], []
    on_trial, close = LiveView.on_trial, LiveView.close
    monkeypatch.setattr(LiveView, "on_trial", lambda view, logged: (shown.append(logged), on_trial(view, logged)))
    monkeypatch.setattr(LiveView, "close", lambda view: (frames.append(view.frames), close(view)))
    call(capsys, *go(moves, tmp_path / "unseen", "-0.12", "0", "--time", "6"))

    status, _, err = call(capsys, *go(moves, tmp_path / "seen", "-0.12", "0", "--time", "6", "--live"))

    assert (status, gaits_of(tmp_path / "seen")) == (1, gaits_of(tmp_path / "unseen"))
    assert "type rerun --connect rerun+http://127.0.0.1:" in err
    assert [logged.trial.number for logged in shown] == [it.trial.number for it in read_run(tmp_path / "seen").trials]
    assert frames[0] > 0


def test_what_is_not_reached_in_time_is_a_failure_with_a_reason(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(capsys, *go(moves, tmp_path / "g", "-0.05", "0.05", "--time", "4"))

    found = json.loads(out)
    assert (status, found["reached"]) == (1, False)
    assert found["reason"].startswith("not there after 4 s of driving; allow more by --time")
    assert found["duration_s"] < 5.1


def test_what_is_too_far_for_the_time_is_told_before_a_motor_turns(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = call(capsys, *go(moves, tmp_path / "g", "9", "0"))

    found = json.loads(out)
    assert (status, found["reached"], found["primitives"]) == (1, False, 0)
    assert found["reason"].startswith("9 0 is 9 m away")
    assert found["reason"].endswith("allow more by --time")
    assert found["run"] is None
    assert not (tmp_path / "g").exists()


def test_go_goes_on_from_where_it_was_interrupted(
    moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from vvvaltr.controller.studies.steering_run import SteeringRun

    record = SteeringRun.record

    def recorded_then_interrupted(run: SteeringRun, logged: LoggedTrial) -> None:
        record(run, logged)
        if len(run.trials) == 2:
            raise KeyboardInterrupt("SIGINT")

    with monkeypatch.context() as patch:
        patch.setattr(SteeringRun, "record", recorded_then_interrupted)
        status, _, err = call(capsys, *go(moves, tmp_path / "g", "0.25", "0.1"))
    assert status == 130
    assert f"--resume {tmp_path / 'g'}" in err
    left_at = read_run(tmp_path / "g").trials[-1].trial.poses[-1]

    status, out, _ = call(capsys, "go", "--resume", str(tmp_path / "g"), "--json")

    trials = read_run(tmp_path / "g").trials
    assert (status, json.loads(out)["reached"]) == (0, True)
    assert [logged.trial.number for logged in trials] == list(range(1, len(trials) + 1))
    assert trials[2].trial.poses[0].position_m[:2] == pytest.approx(left_at.position_m[:2], abs=0.005)
    assert json.loads(out)["primitives"] == len(trials)


def test_the_planar_twin_goes_along_its_line(
    planar_moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ("--robot", "planar", "--repertoire", str(planar_moves), "--json")
    for x_m in ("0.1", "-0.1"):
        status, out, _ = call(capsys, "go", x_m, *common, "--out", str(tmp_path / f"to{x_m}"))
        assert (status, json.loads(out)["reached"]) == (0, True)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("0.1", "0.1", "--robot", "planar", "--repertoire", "PLANAR"), "leave out Y"),
        (("0.1", "--robot", "spatial", "--repertoire", "MOVES"), "Y is missing"),
        (("0.1", "0.1", "--robot", "spatial"), "--repertoire"),
        (("0.1", "0.1", "--robot", "spatial", "--repertoire", "nowhere"), "nowhere"),
        (("0.1", "0.1", "--robot", "spatial", "--repertoire", "PLANAR"), "turns"),
        (("0.1", "--robot", "planar", "--repertoire", "MOVES"), "other motors"),
        (("--robot", "spatial", "--repertoire", "MOVES"), "where to go"),
        (("--path", "none.csv", "--robot", "spatial", "--repertoire", "MOVES"), "none.csv"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    moves: Path,
    planar_moves: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: Sequence[str],
    said: str,
) -> None:
    places = {"MOVES": str(moves), "PLANAR": str(planar_moves)}

    status, out, err = call(capsys, "go", *(places.get(a, a) for a in arguments), "--out", str(tmp_path / "g"))

    assert status in (1, 2)
    assert out == ""
    assert len(err.splitlines()) == 1
    assert said in err
    assert not (tmp_path / "g").exists()


@pytest.mark.parametrize("line", ["0.1", "0.1,b", "0.1,0.2,0.3,0.4", "0.1,nan"])
def test_a_bad_way_point_is_named(moves: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str) -> None:
    (tmp_path / "bad.csv").write_text(f"x,y\n0,0\n{line}\n")

    status, _, err = call(capsys, *go(moves, tmp_path / "g", "--path", str(tmp_path / "bad.csv")))

    assert status in (1, 2)
    assert "way point 2" in err
