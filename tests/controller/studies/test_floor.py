import json
import math

import pytest

from vvvaltr.controller.cli.main import main
from vvvaltr.controller.loop.movement import measure_movement
from vvvaltr.controller.runs.listing import State, describe_run
from vvvaltr.controller.runs.log import LOG_NAME, read_run
from vvvaltr.twin.scatter import Scatter

ASKED = ["--gait", "40,-35,30", "--trials", "6", "--duration", "4", "--json", "-q"]


def floor(capsys, *arguments):
    status = main(["floor", *arguments])
    out, err = capsys.readouterr()
    return status, json.loads(out.splitlines()[-1]) if out else {}, err


def test_an_inclined_floor_is_found_with_its_direction_and_the_run_says_it_again(tmp_path, capsys):
    run = tmp_path / "floor"
    inclined = ["--scatter", "careful:incline_rad=0.05", "--seed", "3"]

    status, found, _ = floor(capsys, "spatial", *inclined, *ASKED, "--out", str(run))

    assert (status, found["is_inclined"], found["trials"]) == (0, True, 6)
    off_rad = math.remainder(found["azimuth_rad"] - Scatter().draw_azimuth_rad(3), math.tau)
    assert abs(off_rad) < math.radians(35)
    assert floor(capsys, str(run), "--json")[1]["drift_m_s"] == pytest.approx(found["drift_m_s"])


def test_a_level_floor_is_not_called_inclined_and_the_robot_is_put_down_all_around(tmp_path, capsys):
    run = tmp_path / "floor"

    status, found, _ = floor(capsys, "spatial", *ASKED, "--out", str(run))

    assert (status, found["is_inclined"]) == (0, False)
    movements = [measure_movement(logged.trial) for logged in read_run(run / LOG_NAME).trials]
    headings = [round(math.degrees(movement.start.yaw_rad) / 60.0) % 6 for movement in movements]
    assert headings == [0, 1, 2, 3, 4, 5]
    listed = describe_run(run)
    assert (listed.robot, listed.trials, listed.state) == ("spatial", 6, State.ASKED)


def test_a_twin_in_a_plane_has_no_heading_that_could_tell(capsys):
    status, _, err = floor(capsys, "planar", "--trials", "2", "--duration", "2", "-q")

    assert status == 2
    assert "the planar twin has no heading" in err


def test_trials_without_poses_are_said_to_tell_nothing(tmp_path, capsys):
    run, table = tmp_path / "lab", tmp_path / "lab.csv"
    table.write_text("a,b,c,mm\n600,700,800,100\n650,700,800,90\n")
    columns = ["--gait", "a,b,c", "--unit", "rpm", "--score", "mm", "--score-unit", "mm", "--duration", "20"]
    assert main(["import", str(table), *columns, "--out", str(run)]) == 0
    capsys.readouterr()

    status, _, err = floor(capsys, str(run))

    assert status == 1
    assert "no valid trial has poses" in err


@pytest.mark.parametrize(
    "asked", [("--trials", "3"), ("--gait", "12,-14,9"), ("--world", "slope"), ("--seed", "0"), ("--out", "new")]
)
def test_a_run_is_not_driven(asked, tmp_path, capsys):
    (tmp_path / LOG_NAME).touch()

    status, _, err = floor(capsys, str(tmp_path), *asked)

    assert status == 2
    assert "leave out all options of trials" in err


def test_of_two_robots_none_is_driven(capsys):
    status, _, err = floor(capsys, "spatial", "--robot", "robot.toml")

    assert status == 2
    assert "leave out spatial or --robot robot.toml" in err


def test_what_is_neither_robot_nor_run_is_not_understood(capsys):
    status, _, err = floor(capsys, "nothing")

    assert status == 2
    assert "neither a robot nor a run" in err
