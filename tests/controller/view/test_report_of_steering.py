"""The report of a run of steering: its movements as a picture, its goals, and the command that makes it again."""

import re
import shlex
from collections.abc import Sequence
from contextlib import closing
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from gliding import GlidingRobot, tried

from vvvaltr.controller.cli.main import make_parser
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Suggestion
from vvvaltr.controller.loop.go import Journey
from vvvaltr.controller.loop.scoring import score
from vvvaltr.controller.loop.steersman import Steersman
from vvvaltr.controller.loop.trial_runner import TrialSettings
from vvvaltr.controller.robot.opening import choose_robot, open_rig
from vvvaltr.controller.runs.errand import Errand
from vvvaltr.controller.studies.steering_run import SteeringRun, load_repertoire, steering_config
from vvvaltr.controller.view.commands import write_making_command
from vvvaltr.controller.view.run_report import write_run_report
from vvvaltr.transfer.steering.planner import Goal
from vvvaltr.transfer.steering.repertoire import Repertoire

GOALS = ((0.2, 0.1, None), (0.0, 0.0, None))


def written(
    path: Path, method: str, trials: Sequence[LoggedTrial], source: Repertoire | None = None, **files: Any
) -> Path:
    """Write a run of steering."""
    rig = open_rig(choose_robot({"name": "spatial"}), 0)
    with closing(rig.robot):
        config = steering_config(choose_robot({"name": "spatial"}), rig, method, 4, 10, 5.0)
    with closing(SteeringRun.create(path, config, Run(), source, **files)) as run:
        for logged in trials:
            run.record(logged)
    return path


@pytest.fixture(scope="module")
def moves(tmp_path_factory: pytest.TempPathFactory) -> Path:
    trials = [LoggedTrial(Suggestion(it.gait, "tried"), it, score(it), None) for it in tried(GlidingRobot(), 2)]
    return written(tmp_path_factory.mktemp("runs") / "moves", "repertoire", trials)


@pytest.fixture(scope="module")
def way(moves: Path) -> Path:
    """Return a run of ``go`` along two goals."""
    known, driven = load_repertoire([moves]), list[LoggedTrial]()
    goals = [Goal(x_m, y_m, yaw_rad=yaw_rad) for x_m, y_m, yaw_rad in GOALS]
    settings = TrialSettings(heading_limit_rad=None)
    for _ in Journey(GlidingRobot(), Steersman(known, 1, None, 0.3), goals, settings, 200.0, driven.append).go():
        pass
    errand = {"goals": GOALS[:1], "within_m": 0.03, "budget_s": 60.5}
    return written(moves.parent / "way", "go", driven, known, errand=errand)


def report(run: Path, page: Path) -> str:
    write_run_report(run, page)
    return unescape(page.read_text())


def command_in(text: str) -> Any:
    """Return the command that makes the run again, as it is understood."""
    command = text.partition("The same again:</p><pre>")[2].partition("</pre>")[0]
    return make_parser().parse_args(shlex.split(command)[1:])


def test_movements_are_arrows_with_their_spread_and_a_table(moves: Path, tmp_path: Path) -> None:
    text = report(moves, tmp_path / "report.html")

    assert text.count("data:image/svg+xml;base64,") == 1
    assert "an ellipse is one standard deviation of a single drive" in text
    assert "No gait is recommended: there was no search" in text
    assert "posterior mean" not in text
    assert text.count("<th scope='row'>") > 5
    assert re.search(r"\+(19|20)\.\d ± ", text)  # mm/s forward of the fastest


def test_the_same_run_gives_the_same_picture(moves: Path, tmp_path: Path) -> None:
    one, other = (report(moves, tmp_path / name) for name in ("a.html", "b.html"))

    assert one == other


def test_goals_are_told_with_what_they_took(way: Path, tmp_path: Path) -> None:
    text = report(way, tmp_path / "report.html")

    assert "The goals, in their order" in text
    assert text.index("0.200, 0.100") < text.index("0.000, 0.000")


def test_the_command_makes_the_same_run_again(moves: Path, way: Path, tmp_path: Path) -> None:
    learned = command_in(report(moves, tmp_path / "moves.html"))
    went = command_in(report(way, tmp_path / "way.html"))

    assert (learned.robot, learned.trials, learned.duration_s, learned.seed) == ("spatial", 10, 5.0, 4)
    assert (went.x_m, went.y_m, went.seed) == (0.2, 0.1, 4)
    assert (went.within_m, went.within_rad, went.budget_s) == (0.03, 0.2, 60.5)


def test_the_command_of_a_way_in_a_plane_has_no_y() -> None:
    choice = choose_robot({"name": "planar"})
    config = steering_config(choice, open_rig(choice, 0), "go", 0, 1, 5.0)

    command = write_making_command(config, Errand(((-0.05, 0.0, None),)))

    assert command.startswith("vvvaltr go -0.05 --robot planar")
