from __future__ import annotations

import math
import signal
import subprocess
import sys
import time
import warnings
from collections import Counter
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pyarrow
import pytest
import rerun as rr
import rerun_cli
from rerun.chunk import RrdReader
from sample_run import STRUCTURE, logged_trial, sample_run, weaker

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.gaits import Gait, GaitSpace
from vvvaltr.controller.core.records import LoggedTrial, Review, Run
from vvvaltr.controller.core.values import Estimate, Outcome, Photo, Pose, Structure
from vvvaltr.controller.loop.movement import measure_pieces
from vvvaltr.controller.loop.trial_runner import TrialSettings, run_trial
from vvvaltr.controller.robot.opening import choose_robot, open_rig
from vvvaltr.controller.runs.log import LOG_NAME, RunLog
from vvvaltr.controller.view.canvas import Canvas
from vvvaltr.controller.view.chart import Axes
from vvvaltr.controller.view.recording import LiveView, Shown, save_recording, show
from vvvaltr.controller.view.scene import Scene
from vvvaltr.controller.view.showing import save_runs
from vvvaltr.controller.view.speed_maps import Belief, list_pairs
from vvvaltr.controller.view.watching import Moment, WatchedRobot
from vvvaltr.controller.view.words import write_about, write_gait, write_result, write_tables

RUN = sample_run(trials=4, poses=21)
SPACE = GaitSpace.over(3, -16.0, 16.0)


def predict(gaits: list[Gait]) -> tuple[Estimate, ...]:
    """Faster, the faster the first motor."""
    means = [gait.frequency_hz[0] / 1000 for gait in gaits]
    return tuple(Estimate(mean, mean - 0.01, mean + 0.01) for mean in means)


def tables(recording: Path) -> dict[str, list[pyarrow.RecordBatch]]:
    """Return what a recording holds, by entity."""
    found: dict[str, list[pyarrow.RecordBatch]] = {}
    for chunk in RrdReader(recording).stream().to_chunks():
        found.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return found


def with_maps(run: Run) -> Shown:
    """Return a run that is shown with the maps of two of its trials."""
    last = run.trials[-1].trial
    return Shown(run, "sample", SPACE, (Belief(1, SPACE, predict, last.gait), Belief(last.number, SPACE, predict)))


def saved(folder: Path, *shown: Shown | Run) -> dict[str, list[pyarrow.RecordBatch]]:
    save_recording(folder / "run.rrd", *(it if isinstance(it, Shown) else Shown(it, "sample") for it in shown))
    return tables(folder / "run.rrd")


def column(batches: list[pyarrow.RecordBatch], name: str) -> list:
    """Return the values of the column whose name ends so, in all rows that have it."""
    return [
        value
        for batch in batches
        for field in batch.schema.names
        if field == name or field.endswith(":" + name)
        for value in batch.column(field).to_pylist()
    ]


def rerun(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rerun", *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_rerun_accepts_the_recording(tmp_path: Path) -> None:
    saved(tmp_path, with_maps(RUN))
    done = rerun("rrd", "verify", tmp_path / "run.rrd")
    assert done.returncode == 0, done.stderr


def test_rerun_accepts_the_log(tmp_path: Path) -> None:
    with RunLog.create(tmp_path / LOG_NAME, RUN.structure, RUN.sources) as log:
        log.append(RUN.trials[0])
    done = rerun("mcap", "info", tmp_path / LOG_NAME)
    assert done.returncode == 0, done.stderr
    assert "foxglove.PoseInFrame" in done.stdout


def test_the_robot_is_drawn_at_every_pose(tmp_path: Path) -> None:
    found = saved(tmp_path, RUN)
    poses = sum(len(logged.trial.poses) for logged in RUN.trials)
    for part, lines in (("struts", 3), ("springs", 6)):
        strips = column(found[f"/world/robot/{part}"], "strips")
        assert len(strips) == poses
        assert all(len(each) == lines for each in strips)
    first = RUN.trials[0].trial.poses[0].markers_m
    drawn = column(found["/world/robot/struts"], "strips")[0][0]
    assert [xyz for end in drawn for xyz in end] == pytest.approx([*first[0], *first[1]])
    assert len(column(found["/world/robot/centre"], "positions")) == poses
    assert len(column(found["/world/trail"], "strips")) == len(RUN.trials)
    assert column(found["/world/label"], "labels")[1] == [
        "trial 2: tracking lost: no pose for 0.3 s: is the tag in view?"
    ]
    assert len(column(found["/world/ground"], "vertex_positions")[0]) == 41 * 2


def test_a_robot_without_markers_is_an_arrow(tmp_path: Path) -> None:
    (trial,) = sample_run(trials=1).trials
    turned = Pose(0.0, (0.1, 0.2, 0.0), yaw_rad=math.pi / 2)
    found = saved(tmp_path, Run(STRUCTURE, (), (replace(trial, trial=replace(trial.trial, poses=(turned,))),)))
    assert column(found["/world/robot/heading"], "vectors") == [[pytest.approx([0.0, 0.06, 0.0])]]
    assert column(found["/world/robot/heading"], "origins") == [[pytest.approx([0.1, 0.2, 0.0])]]


def test_commanded_and_applied_frequencies_are_apart_and_end_with_each_trial(tmp_path: Path) -> None:
    found = saved(tmp_path, RUN)
    for motor in range(3):
        for name in ("commanded", "applied"):
            values = [value for (value,) in column(found[f"/motors/{motor + 1}/{name}"], "scalars")]
            assert len(values) == 4 * (21 + 1)
            assert [value != value for value in values[21::22]] == [True] * 4
    last = RUN.trials[0].trial.commands[-1].gait.frequency_hz[0]
    assert column(found["/motors/1/commanded"], "scalars")[20] == [last]


def test_speeds_are_per_valid_trial_in_mm_s(tmp_path: Path) -> None:
    found = saved(tmp_path, RUN)
    scores = [1000 * logged.score for logged in RUN.trials if logged.score is not None]
    assert column(found["/speed/measured"], "scalars") == [[pytest.approx(score)] for score in scores]
    assert column(found["/speed/best_measured"], "scalars")[-1] == [pytest.approx(max(scores))]
    estimate = RUN.trials[-1].recommendation.estimate
    for name, value in (("mean", estimate.mean), ("low", estimate.low), ("high", estimate.high)):
        assert column(found[f"/speed/best_gait/{name}"], "scalars")[-1] == [pytest.approx(1000 * value)]


def test_both_time_lines_lead_through_the_run(tmp_path: Path) -> None:
    struts = saved(tmp_path, RUN)["/world/robot/struts"]
    trials = column(struts, "trial")
    assert Counter(trials) == {1: 21, 2: 21, 3: 21, 4: 21}
    times_s = [time.total_seconds() for time in column(struts, "time")]
    assert times_s[0] == 0
    assert times_s == sorted(times_s)
    assert times_s[-1] == pytest.approx(4.0)


def test_the_maps_show_the_expected_speed_of_each_pair_of_motors(tmp_path: Path) -> None:
    found = saved(tmp_path, with_maps(RUN))
    assert {path.split("/")[2] for path in found if path.startswith("/learned/")} == {
        "motors_1_2",
        "motors_1_3",
        "motors_2_3",
    }
    _, picture = column(found["/learned/motors_1_2/speed"], "buffer")
    pixels = [tuple(picture[0][at : at + 3]) for at in range(0, 25 * 25 * 3, 3)]
    assert pixels[0] == (68, 1, 84)  # slow to the left, fast to the right
    assert sum(pixels[24]) > sum(pixels[0])
    (axes,) = column(found["/learned/motors_1_2/axes"], "labels")
    assert {"motor 1 (Hz)", "motor 2 (Hz)", "mm/s", "-10", "10"} <= set(axes)


def test_of_many_motors_only_so_many_pairs_are_mapped_as_can_be_waited_for() -> None:
    assert len(list_pairs(GaitSpace.over(10, 5.0, 50.0))) == 45
    assert len(list_pairs(GaitSpace.over(60, 5.0, 50.0))) == 45


def test_the_maps_tell_the_speed_of_each_trial_the_best_gait_and_the_next_one(tmp_path: Path) -> None:
    found = saved(tmp_path, with_maps(RUN))
    early, late = column(found["/learned/motors_1_2/tried"], "positions")
    assert (len(early), len(late)) == (1, 3)  # one of the four measured nothing
    colours = column(found["/learned/motors_1_2/tried"], "colors")[-1]
    assert len(set(colours)) > 1
    assert [len(each) for each in column(found["/learned/motors_1_2/best"], "strips")] == [1, 1]
    assert [len(each) for each in column(found["/learned/motors_1_2/next"], "strips")] == [1, 0]


def test_what_is_known_grows_with_the_trials(tmp_path: Path) -> None:
    found = saved(tmp_path, with_maps(RUN))
    assert [len(each) for each in column(found["/chart/measured"], "positions")] == [1, 2, 3, 4]
    assert [text.splitlines()[2].split(" |")[0] for (text,) in column(found["/trials"], "text")] == [
        "| 1",
        "| 2",
        "| 3",
        "| 4",
    ]
    assert [len(each[0]) for each in column(found["/chart/mean"], "strips")] == [1, 1, 2, 3]
    assert column(found["/learned/motors_1_2/speed"], "trial") == [1, 4]


def test_the_axis_of_speeds_follows_what_was_measured_and_not_the_first_interval() -> None:
    first = replace(RUN.trials[0].recommendation, estimate=Estimate(0.0, -1.0, 1.0))
    trials = (replace(RUN.trials[0], recommendation=first), *RUN.trials[1:])
    axes = Axes.around(trials)
    fastest = max(1000 * logged.score for logged in trials if logged.score is not None)
    assert axes.low == 0
    assert fastest < axes.high < 3 * fastest


def test_the_table_tells_why_a_trial_measured_nothing_and_why_one_is_suspect() -> None:
    rows = write_tables(RUN.trials, [len(RUN.trials)])[0].splitlines()
    assert rows[0] == "| trial | gait (Hz) | mm/s | outcome | why |"
    assert "no pose for 0.3 s: is the tag in view?" in rows[4]
    assert "suspect: turned faster than it can" in rows[2]


def test_a_trial_without_a_measurement_is_marked_on_the_motors_plot(tmp_path: Path) -> None:
    found = saved(tmp_path, RUN)
    assert column(found["/motors/fault"], "trial") == [2]


def test_goal_and_predicted_displacement_of_steering_are_drawn(tmp_path: Path) -> None:
    found = saved(tmp_path, RUN)
    assert column(found["/world/goal"], "positions")[0][0] == pytest.approx([0.3, 0.1, 0.002])
    start = RUN.trials[0].movement.start.yaw_rad
    assert column(found["/world/plan"], "vectors")[0][0] == pytest.approx(
        [0.04 * math.cos(start), 0.04 * math.sin(start), 0.0], abs=1e-6
    )


def going(number: int, goal_yaw_rad: float | None) -> LoggedTrial:
    """Return a movement of steering, which ends 50 mm before its goal."""
    logged = replace(logged_trial(number), recommendation=None, review=Review())
    end = logged.trial.poses[-1]
    goal_m = (end.position_m[0] + 0.03, end.position_m[1] + 0.04)
    return replace(logged, steering=replace(logged.steering, goal_m=goal_m, goal_yaw_rad=goal_yaw_rad))


def test_a_run_of_steering_tells_how_far_it_is_to_the_goal_and_what_was_planned(tmp_path: Path) -> None:
    found = saved(tmp_path, Run(STRUCTURE, (), (going(1, None), going(2, 1.02))))
    first, second = (text for (text,) in column(found["/result"], "text"))
    assert first.startswith("### Going to ") and "**50 mm to go**, after 1 movement\n" in first
    assert "**50 mm to go**, 1.00 rad to turn" in second
    assert "2 up to the goal; this one was to take the robot 40 mm forward, 0 mm to the left" in second
    assert [len(arrows) for arrows in column(found["/world/goal/heading"], "vectors")] == [0, 1]
    (heading,) = column(found["/world/goal/heading"], "vectors")[1]
    assert heading == pytest.approx([0.06 * math.cos(1.02), 0.06 * math.sin(1.02), 0.0])
    assert not any("best gait" in label for labels in column(found["/chart/axes"], "labels") for label in labels)


def test_one_trial_is_shown_alone_with_what_was_known_after_it(tmp_path: Path) -> None:
    found = saved(tmp_path, replace(with_maps(RUN), trial=3))
    assert set(column(found["/world/robot/struts"], "trial")) == {3}
    assert [len(each) for each in column(found["/chart/measured"], "positions")] == [3]
    assert column(found["/world/robot/struts"], "time")[0].total_seconds() == 0


def test_a_trial_that_does_not_exist_is_refused_before_anything_is_recorded() -> None:
    with pytest.raises(UserError, match=r"sample has no trial 17: it has 4, counted from 1"):
        replace(with_maps(RUN), trial=17)


def test_runs_are_shown_side_by_side_below_their_names(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    found = saved(tmp_path, Shown(RUN, "source"), Shown(RUN, "target"))
    for root in ("/source", "/target"):
        assert len(column(found[f"{root}/world/robot/struts"], "strips")) == 4 * 21
    same = saved(tmp_path, Shown(RUN, "flat"), Shown(RUN, "flat"))
    assert {"/flat (1)/result", "/flat (2)/result"} <= {path.replace("\\", "") for path in same}
    assert "Result: flat (1)" in print_recording(tmp_path / "run.rrd")
    assert "WARN" not in capfd.readouterr().err


def test_gaits_that_differ_in_their_phases_alone_are_told_apart() -> None:
    assert write_gait(Gait((9.0, -12.0))) == "9.0 / -12.0 Hz"
    assert write_gait(Gait((9.0, -12.0), (0.0, 1.5)), 2) == "9.00 / -12.00 Hz, phases 0.00 / 1.50 rad"
    assert write_gait(Gait((9.0, -12.0), amplitude=(1.0, 0.5))) == "9.0 / -12.0 Hz, amplitudes 1.00 / 0.50"


def test_a_twin_says_that_its_scatter_is_simulated() -> None:
    assert "scatter between repeats is simulated" in write_about(replace(RUN, about={"robot": "planar"}))
    assert "simulated" not in write_about(replace(RUN, about={"robot": "robot.toml"}))


def test_no_letter_that_the_viewers_font_lacks_is_sent_to_it(tmp_path: Path) -> None:
    failed = logged_trial(2, outcome=Outcome.LINK_LOST)
    odd = replace(failed, trial=replace(failed.trial, reason="線 broke ▬ é"))
    run = replace(RUN, trials=(RUN.trials[0], odd), about={"robot": "線.toml"})
    found = saved(tmp_path, Shown(run, "a"), Shown(run, "線"))
    texts = [text for batches in found.values() for batch in batches for text in texts_in(batch)]
    assert "trial 2: link lost: ? broke ? é" in texts
    assert any("robot ?.toml" in text for text in texts)
    assert all(ord(letter) < 0x250 for text in (*texts, *found) for letter in text)
    written = print_recording(tmp_path / "run.rrd")
    assert "Speed of each trial: ?" in written
    assert "線" not in written


def print_recording(recording: Path) -> str:
    """Return all that is in a recording as text, with the layout."""
    return rerun("rrd", "print", "-vvv", recording).stdout


def texts_in(batch: pyarrow.RecordBatch) -> list[str]:
    """Return all texts in a batch, but the names of its columns."""
    columns = [column for column in batch.columns if "string" in str(column.type)]
    return [text for column in columns for row in column.to_pylist() for text in row or ()]


def test_pictures_of_the_camera_are_shown_over_the_time_of_their_trial(tmp_path: Path) -> None:
    photos = (Photo(0.25, b"first"), Photo(0.75, b"second"))
    seen = replace(RUN.trials[2], trial=replace(RUN.trials[2].trial, photos=photos))
    run = replace(RUN, trials=(*RUN.trials[:2], seen))
    found = saved(tmp_path, run)
    assert [bytes(blob) for (blob,) in column(found["/camera"], "blob")] == [b"first", b"second"]
    assert column(found["/camera"], "media_type") == [["image/jpeg"]] * 2
    assert set(column(found["/camera"], "trial")) == {3}
    begins_s = column(found["/world/label"], "time")[2].total_seconds()
    times_s = [time.total_seconds() - begins_s for time in column(found["/camera"], "time")]
    assert times_s == pytest.approx([0.25, 0.75])
    assert "Camera, once a second" in print_recording(tmp_path / "run.rrd")


def test_a_run_without_pictures_has_no_view_for_them(tmp_path: Path) -> None:
    assert "/camera" not in saved(tmp_path, RUN)
    assert "Camera, once a second" not in print_recording(tmp_path / "run.rrd")


def test_a_loss_of_strength_is_marked_from_when_it_was_known(tmp_path: Path) -> None:
    found = saved(tmp_path, Run(STRUCTURE, (), tuple(weaker(24, since=13))))
    counts = dict(zip(column(found["/chart/loss"], "trial"), column(found["/chart/loss"], "strips"), strict=True))
    assert [len(counts[trial]) for trial in (5, 10, 24)] == [0, 0, 1]
    assert column(found["/chart/loss_factor"], "labels")[-1] == ["strength x 0.47"]
    x = counts[24][0][0][0]
    assert x == pytest.approx(200.0 * 12.5 / 24)
    texts = [text for (text,) in column(found["/result"], "text")]
    assert "Strength: from trial 13 on the robot moved 0.47 times as far" in texts[-1]
    assert "Strength" not in texts[9]


def test_reference_trials_are_told_apart_from_the_search(tmp_path: Path) -> None:
    found = saved(tmp_path, Run(STRUCTURE, (), tuple(weaker(11, since=99))))
    colours = column(found["/chart/measured"], "colors")[-1]
    assert [number for number, colour in enumerate(colours, 1) if colour == colours[0]] == [1, 6, 11]
    assert any("reference" in labels for labels in column(found["/chart/axes"], "labels"))
    assert "Reference: trials 1 with 31.0, 6 with 30.0, 11 with 32.0 mm/s" in column(found["/result"], "text")[-1][0]


def test_suspect_trials_are_named_in_the_result(tmp_path: Path) -> None:
    assert "Suspect: trials 1, 3, 4" in column(saved(tmp_path, RUN)["/result"], "text")[-1][0]


def test_a_view_that_gets_trials_one_by_one_tells_of_causes_a_few_trials_after_they_show(tmp_path: Path) -> None:
    with rr.RecordingStream("test") as recording:
        recording.save(tmp_path / "run.rrd")
        scene = Scene(Canvas(recording), STRUCTURE)
        for logged in weaker(24, since=13):
            scene.add([logged])
    texts = [text for (text,) in column(tables(tmp_path / "run.rrd")["/result"], "text")]
    told = [number for number, text in enumerate(texts, 1) if "Strength" in text]
    assert 13 < told[0] <= 20
    assert told == list(range(told[0], 25))


def test_an_inclined_floor_is_an_arrow_as_long_as_the_way_it_carries_the_robot(tmp_path: Path) -> None:
    drift_m_s = (0.004, -0.003)
    run = Run(STRUCTURE, (), tuple(on_a_slope(number, drift_m_s) for number in range(1, 11)))
    found = saved(tmp_path, run)
    (arrow,) = column(found["/world/floor"], "vectors")[-1]
    assert arrow == pytest.approx([4.0 * drift_m_s[0], 4.0 * drift_m_s[1], 0.0], abs=0.003)
    assert column(found["/world/floor/label"], "labels")[-1][0].startswith("floor: 4.")
    assert "Floor: inclined" in column(found["/result"], "text")[-1][0]


def on_a_slope(number: int, drift_m_s: tuple[float, float]) -> LoggedTrial:
    """Return a trial of 4 s at a heading of its own, at 20 mm/s along it, that the floor carries aside."""
    yaw, logged = 0.7 * number, logged_trial(number, poses=3)
    velocity = (0.02 * math.cos(yaw) + drift_m_s[0], 0.02 * math.sin(yaw) + drift_m_s[1])
    poses = tuple(Pose(t, (velocity[0] * t, velocity[1] * t, 0.04), yaw) for t in (0.1 * step for step in range(41)))
    gait = Gait((12.0, -14.0, 9.0))
    trial = replace(logged.trial, gait=gait, poses=poses, duration_s=4.0)
    return replace(logged, trial=trial, score=0.02, pieces=measure_pieces(trial))


def test_a_bare_log_opens_as_well_as_its_directory(tmp_path: Path) -> None:
    with RunLog.create(tmp_path / "elsewhere.mcap", RUN.structure) as log:
        log.append(RUN.trials[0])
    save_runs([tmp_path / "elsewhere.mcap"], tmp_path / "run.rrd")
    assert len(column(tables(tmp_path / "run.rrd")["/world/robot/struts"], "strips")) == 21


def test_before_the_first_valid_trial_there_is_nothing_to_map(tmp_path: Path) -> None:
    def unready(gaits: list[Gait]) -> tuple[Estimate, ...]:
        raise ValueError("nothing learned yet")

    failed = Run(STRUCTURE, (), (logged_trial(1, outcome=Outcome.LINK_LOST),))
    found = saved(tmp_path, Shown(failed, "sample", SPACE, (Belief(1, SPACE, unready),)))
    assert not any(path.startswith("/learned/") for path in found)
    assert "No gait yet" in column(found["/result"], "text")[0][0]


def test_the_result_tells_the_posterior_and_not_the_luckiest_trial() -> None:
    recommendation = RUN.trials[-1].recommendation
    text = write_result(RUN.trials)
    assert f"**{1000 * recommendation.estimate.mean:.1f} mm/s** (posterior mean)" in text
    assert "3 completed, 1 tracking lost" in text


@pytest.mark.parametrize(
    "run",
    [
        Run(),
        Run(None, (), RUN.trials),
        Run(STRUCTURE, (), (replace(RUN.trials[0], trial=replace(RUN.trials[0].trial, poses=(), states=())),)),
        Run(Structure(((0, 9),), (), (3,)), (), RUN.trials),
        Run(
            None,
            (),
            (replace(RUN.trials[0], trial=replace(RUN.trials[0].trial, poses=(Pose(0.0, (float("nan"),) * 3),))),),
        ),
    ],
    ids=["empty", "no structure", "nothing recorded", "markers missing", "no number"],
)
def test_a_run_that_lacks_something_is_shown_without_it(tmp_path: Path, run: Run) -> None:
    found = saved(tmp_path, Shown(run, "sample", SPACE))
    assert ("/result" in found) == bool(run.trials)
    assert column(found.get("/world/robot/struts", []), "strips") == []


def test_an_unwritable_recording_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"nowhere/run\.rrd cannot be written"):
        save_recording(tmp_path / "nowhere" / "run.rrd", Shown(RUN, "sample"))


def test_a_full_disk_ends_the_recording_leaves_nothing_and_does_not_fail_the_run(tmp_path: Path) -> None:
    run = tmp_path / "run"
    program = (
        "import resource, signal, sys\n"
        "from vvvaltr.controller.view import showing; from vvvaltr.controller.cli.main import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); save = showing.save_run\n"
        "def save_on_little_room(*paths):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); save(*paths)\n"
        "showing.save_run = save_on_little_room; sys.exit(main())"
    )
    options = ("learn", "--robot", "planar", "--trials", "2", "--duration", "0.5", "--out", str(run))

    done = subprocess.run(
        [sys.executable, "-c", program, *options], capture_output=True, text=True, timeout=60, check=False
    )

    assert done.returncode == 0, done.stderr
    assert f"no Rerun recording: {run / 'run.rrd'} cannot be written: File too large" in done.stderr
    assert not list(run.glob("run.rrd*"))


def test_without_a_screen_the_user_is_told_what_else_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(UserError, match=r"no screen.*--web.*--save"):
        show(Shown(RUN, "sample"))


def receive(live: LiveView, path: Path) -> dict[str, list[pyarrow.RecordBatch]]:
    """Return what a viewer gets that connects now."""
    command = [
        Path(rerun_cli.__file__).with_name("rerun"),
        live.url,
        "--save",
        path,
        "--bind",
        "127.0.0.1",
        "--port",
        "0",
    ]
    with subprocess.Popen(list(map(str, command)), stderr=subprocess.DEVNULL) as viewer:
        wait_until_complete(path)
        viewer.send_signal(signal.SIGINT)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the file has no footer: the viewer was interrupted
        return tables(path)


def wait_until_complete(path: Path) -> None:
    """Wait until the file holds more than its header, and has not grown for a second."""
    sizes = [-1, 0]
    while sizes[-1] < 10_000 or len(set(sizes[-3:])) > 1:
        time.sleep(0.5)
        sizes.append(path.stat().st_size if path.exists() else 0)


def test_a_live_view_serves_the_run_to_a_viewer_that_comes_late(tmp_path: Path) -> None:
    live = LiveView(replace(RUN, trials=RUN.trials[:2]), "sample", SPACE, predict)
    for logged in RUN.trials[2:]:
        live.on_trial(logged)
    received = receive(live, tmp_path / "received.rrd")
    live.close()
    assert set(received) == set(saved(tmp_path, with_maps(RUN)))
    assert len(column(received["/world/robot/struts"], "strips")) == 4 * 21


class Clock:
    def now_s(self) -> float:
        return 100.0


class Running:
    """A robot in the middle of a trial: what it reads is always the same."""

    structure, clock = STRUCTURE, Clock()
    motors = tracker = None


def test_a_trial_is_shown_while_it_runs_ten_times_a_second(tmp_path: Path) -> None:
    live = LiveView(Run(STRUCTURE), "sample")
    watched = live.watch(Running())
    pose, state = RUN.trials[0].trial.poses[0], RUN.trials[0].trial.states[0]
    began_s = time.monotonic()
    for step in range(25):
        t_s = 100.0 + 0.04 * step
        read = replace(pose, t_s=t_s), replace(state, t_s=t_s)
        watched.moment = Moment(1, time.time(), 100.0, RUN.trials[0].trial.gait, *read)
        time.sleep(0.04)
    taken_s = time.monotonic() - began_s
    received = receive(live, tmp_path / "received.rrd")
    live.close()
    shown = column(received["/world/robot/struts"], "strips")
    assert 5 * taken_s < len(shown) <= 10 * taken_s + 1
    assert len(column(received["/motors/3/applied"], "scalars")) == len(shown)
    assert set(column(received["/world/robot/struts"], "trial")) == {1}


def test_a_watched_robot_moves_exactly_as_it_does_unwatched() -> None:
    gait, settings = Gait((12.0, 9.0, 7.0)), TrialSettings(duration_s=0.5)
    trials = []
    for watch in (lambda robot: robot, WatchedRobot):
        with closing(open_rig(choose_robot({"name": "planar"}), seed=3).robot) as robot:
            trials.append(run_trial(watch(robot), gait, settings))
    plain, watched = trials
    assert replace(watched, started_unix_s=plain.started_unix_s) == plain


def test_a_watch_holds_the_last_reading_of_a_trial_and_nothing_between_trials() -> None:
    with closing(open_rig(choose_robot({"name": "planar"}), seed=3).robot) as robot:
        watched = WatchedRobot(robot)
        watched.place(7)
        watched.motors.drive(Gait((9.0, 9.0, 9.0)), 0.2)
        watched.clock.sleep(0.05)
        state, pose = watched.motors.state(), watched.tracker.pose()
        moment = watched.moment
        watched.motors.stop()
    assert (moment.trial, moment.state, moment.pose) == (7, state, pose)
    assert moment.asked == Gait((9.0, 9.0, 9.0))
    assert pose.t_s - moment.drive_s == pytest.approx(0.05)
    assert watched.moment is None


def test_a_live_view_of_a_resumed_run_asks_nothing_of_an_optimiser_that_was_told_nothing() -> None:
    def unready(gaits: list[Gait]) -> tuple[Estimate, ...]:
        raise ValueError("nothing learned yet")

    LiveView(RUN, "sample", SPACE, unready).close()


def test_a_live_view_without_a_viewer_costs_nothing_but_its_own_work() -> None:
    live = LiveView(Run(STRUCTURE), "sample")
    live.on_trial(logged_trial(1))
    live.close()
    live.close()


def test_two_live_views_do_not_get_in_each_others_way() -> None:
    first, second = LiveView(Run(), "first"), LiveView(Run(), "second")
    assert first.url != second.url
    first.close()
    second.close()
