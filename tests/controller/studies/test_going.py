"""What `go` refuses: goals that must not be reached, and repertoires by which no robot can be steered."""

import json
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from shutil import rmtree

import msgspec
import pytest
from gliding import GAITS, GlidingRobot, Velocity, tried

from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.gaits import Gait
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Estimate, Recommendation, Suggestion
from vvvaltr.controller.loop.safety import Arena
from vvvaltr.controller.robot.choice import RobotChoice
from vvvaltr.controller.robot.opening import choose_robot, open_rig
from vvvaltr.controller.runs.errand import Errand, load_errand
from vvvaltr.controller.runs.listing import describe_run
from vvvaltr.controller.runs.log import read_run
from vvvaltr.controller.runs.run import RunDirectory
from vvvaltr.controller.studies.going import GoRun, check_errand, read_goals, usable_repertoire
from vvvaltr.controller.studies.repertoire import put_together
from vvvaltr.controller.studies.steering_run import SteeringRun, load_repertoire, steering_config

SPATIAL, ROBOT = RobotChoice("spatial"), RobotChoice("robot.toml", file={})


def run_of(path: Path, table: Mapping[Gait, Velocity], best: Recommendation | None = None) -> Path:
    """Return a run in which each gait of a table was tried twice, perhaps with a recommendation after each trial."""
    choice = choose_robot({"name": "planar"})
    config = steering_config(choice, open_rig(choice, 0), "repertoire", 0, 10, 5.0)
    with closing(SteeringRun.create(path, config, Run())) as run:
        for trial in tried(GlidingRobot(dict(table)), 2):
            run.record(LoggedTrial(Suggestion(trial.gait, "tried"), trial, 0.02, best))
    return path


def test_a_robot_that_was_never_seen_is_nowhere(tmp_path: Path) -> None:
    source = run_of(tmp_path / "moves", {gait: (0.01 * number, 0.0, 0.0) for number, gait in enumerate(GAITS, start=1)})

    with closing(GoRun.create(tmp_path / "go", {"name": "planar"}, 0, [source], Errand(((0.0, 0.0, None),)))) as run:
        found = run.summarise()

    assert (found["reached"], found["position_m"], found["error_m"]) == (False, None, None)
    assert json.loads((tmp_path / "go" / "summary.json").read_text())["yaw_rad"] is None


def test_a_run_of_steering_is_not_resumed_as_a_search(tmp_path: Path) -> None:
    moves = run_of(tmp_path / "moves", {gait: (0.01 * number, 0.0, 0.0) for number, gait in enumerate(GAITS, start=1)})

    went, jogged = (steered_from(tmp_path / method, moves, method) for method in ("go", "jog"))

    for run, cure in (
        (moves, f"go on by vvvaltr repertoire --resume {moves}"),
        (went, f"go on by vvvaltr go --resume {went}"),
        (jogged, "drive again by vvvaltr jog"),
    ):
        with pytest.raises(UserError, match=f"not of a search: {cure}$"):
            RunDirectory.resume(run, {})
    with pytest.raises(UserError, match=f"is a run of 'repertoire', not of 'go': go on by .* --resume {moves}$"):
        GoRun.resume(moves)


def test_a_goal_outside_the_arena_is_refused() -> None:
    arena = Arena((-0.5, 0.5), (-0.3, 0.3))

    check_errand(Errand(((0.4, 0.2, None),)), arena, ROBOT)
    with pytest.raises(NotUnderstood, match=r"goal 0\.4 0\.4 is outside the arena"):
        check_errand(Errand(((0.4, 0.2, None), (0.4, 0.4, None))), arena, ROBOT)


@pytest.mark.parametrize("x_m", [1e300, -1001.0])
def test_a_goal_beyond_any_laboratory_is_refused(x_m: float) -> None:
    with pytest.raises(NotUnderstood, match="further than 1000 m: give x and y in m"):
        check_errand(Errand(((x_m, 0.0, None),)), None, ROBOT)


@pytest.mark.parametrize(
    "text", ["0.05;0\n0.1,0\n", "0,05 0\n0.1,0\n", "x,y\n0.05;0\n0.1,0\n", "nan,0\n0.1,0\n", ",0.1\n0.1,0\n"]
)
def test_a_first_way_point_that_is_not_understood_is_not_taken_for_a_header(tmp_path: Path, text: str) -> None:
    path = tmp_path / "way.csv"
    path.write_text(text)

    with pytest.raises(NotUnderstood, match="way point 1 is"):
        read_goals(path)


@pytest.mark.parametrize("header", ["", "x,y\n", "# metres\n", "X1 (m),Y1 (m)\n"])
def test_way_points_stand_under_a_header_or_none(tmp_path: Path, header: str) -> None:
    path = tmp_path / "way.csv"
    path.write_text(f"{header}0.05,-0.1\n-.1,0,1.5\n")

    assert read_goals(path) == ((0.05, -0.1, None), (-0.1, 0.0, 1.5))


@pytest.mark.parametrize("change", [{"goals": []}, {"within_m": -1.0}, {"within_rad": 0.0}, {"budget_s": 0.0}])
def test_an_errand_that_no_run_wrote_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    (tmp_path / "errand.json").write_text(json.dumps({"goals": [[0.1, 0.0, None]], **change}))

    with pytest.raises(UserError, match=f"{next(iter(change))}`; restore the file as the run wrote it"):
        load_errand(tmp_path)


def test_movements_that_do_not_turn_are_refused(tmp_path: Path) -> None:
    run = run_of(tmp_path / "straight", {GAITS[0]: (0.02, 0.0, 0.005), GAITS[1]: (-0.02, 0.0, -0.004)})

    with pytest.raises(UserError, match="no movement turns"):
        usable_repertoire(SPATIAL, [run])


def test_a_tracker_without_heading_is_told(tmp_path: Path) -> None:
    run = run_of(tmp_path / "point", {GAITS[0]: (0.02, 0.0, 0.0), GAITS[1]: (0.0, 0.02, 0.0)})

    with pytest.raises(UserError, match="no heading"):
        usable_repertoire(SPATIAL, [run])


def test_gaits_of_other_motors_make_no_repertoire_together(tmp_path: Path) -> None:
    three = run_of(tmp_path / "three", {GAITS[0]: (0.02, 0.0, 0.2)})
    two = run_of(tmp_path / "two", {Gait((5.0, 6.0)): (0.02, 0.0, 0.2)})

    with pytest.raises(UserError, match="2 and 3 motors"):
        load_repertoire([three, two])


def test_runs_put_together_recommend_nothing(tmp_path: Path) -> None:
    best = Recommendation(GAITS[0], Estimate(0.02, 0.01, 0.03))
    searched = run_of(tmp_path / "searched", {GAITS[0]: (0.02, 0.0, 0.2), GAITS[1]: (0.0, 0.02, -0.2)}, best)

    put_together([searched], tmp_path / "together")

    trials = read_run(tmp_path / "together").trials
    assert len(trials) == 4
    assert all(logged.recommendation is None for logged in trials)
    assert describe_run(tmp_path / "together").trials == 4


def steered_from(path: Path, source: Path, method: str = "go") -> Path:
    """Write a run that began with ``source`` and drove nothing."""
    choice = choose_robot({"name": "planar"})
    config = steering_config(choice, open_rig(choice, 0), method, 0, 1, 5.0)
    config = msgspec.structs.replace(config, sources=(str(source),))
    SteeringRun.create(path, config, Run(), load_repertoire([source])).close()
    return path


def test_a_run_that_another_one_began_with_counts_once(tmp_path: Path) -> None:
    moves = run_of(tmp_path / "moves", {GAITS[0]: (0.02, 0.0, 0.2)})
    went = steered_from(tmp_path / "went", moves)
    together, again = tmp_path / "together", tmp_path / "again"
    put_together([moves], together)

    for paths in (
        [moves, went],
        [moves, steered_from(again, went)],  # at second hand
        [moves, together],
        [steered_from(tmp_path / "later", together), moves],
        [moves, tmp_path / "moves" / ".." / "moves"],
    ):
        assert load_repertoire(paths).movements[0].trials == 2, paths


def test_of_two_runs_that_name_each_other_one_counts(tmp_path: Path) -> None:
    moves = run_of(tmp_path / "moves", {GAITS[0]: (0.02, 0.0, 0.2)})
    went = steered_from(tmp_path / "went", moves)
    rmtree(moves)
    put_together([went], moves)

    assert load_repertoire([moves, went]).movements[0].trials == 2
