"""Forces in the view: they come with the poses of a twin that tells them, and are missing without harm from others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rerun.chunk import RrdReader
from sample_run import sample_run

from vvvaltr.controller.core.records import Run
from vvvaltr.controller.view.recording import Shown, save_recording

RUN = sample_run(trials=1)
POSES = RUN.trials[0].trial.poses


def column(folder: Path, run: Run, entity: str, name: str) -> list:
    """Return what a recording of ``run`` holds of an entity, a list for each pose."""
    save_recording(folder / "run.rrd", Shown(run, "sample"))
    return [
        value
        for chunk in RrdReader(folder / "run.rrd").stream().to_chunks()
        if str(chunk.entity_path) == entity
        for field in chunk.to_record_batch().schema.names
        if field.endswith(":" + name)
        for value in chunk.to_record_batch().column(field).to_pylist()
    ]


def without_forces(run: Run) -> Run:
    blind = tuple(replace(pose, forces=None) for pose in run.trials[0].trial.poses)
    return replace(run, trials=(replace(run.trials[0], trial=replace(run.trials[0].trial, poses=blind)),))


def test_a_spring_is_the_redder_and_the_less_blue_the_more_it_pulls(tmp_path: Path) -> None:
    colours = column(tmp_path, RUN, "/world/robot/springs", "colors")

    assert len(colours) == len(POSES)
    for pose, of_springs in zip(POSES, colours, strict=True):
        by_tension = [colour for _, colour in sorted(zip(pose.forces.tensions_n, of_springs, strict=True))]
        reds, blues = [colour >> 24 for colour in by_tension], [colour >> 8 & 255 for colour in by_tension]
        assert reds == sorted(reds)
        assert blues == sorted(blues, reverse=True)
        assert reds[0] < reds[-1]


def test_contacts_are_shown_while_they_last(tmp_path: Path) -> None:
    points = column(tmp_path, RUN, "/world/robot/contacts", "positions")

    assert [len(each) for each in points[-len(POSES) :]] == [len(pose.forces.contacts_m) for pose in POSES]
    assert {len(pose.forces.contacts_m) for pose in POSES} == {0, 2}


def test_the_motors_push_at_the_middles_of_their_struts(tmp_path: Path) -> None:
    origins = column(tmp_path, RUN, "/world/robot/motor_forces", "origins")
    vectors = column(tmp_path, RUN, "/world/robot/motor_forces", "vectors")

    top, bottom = POSES[3].markers_m[2:4]
    assert origins[3][1] == pytest.approx([(a + b) / 2.0 for a, b in zip(top, bottom, strict=True)])
    assert vectors[3][1] == pytest.approx([0.05 * part for part in POSES[3].forces.motors_n[1]])


def test_a_robot_that_tells_no_forces_has_plain_springs_and_no_arrows(tmp_path: Path) -> None:
    blind = without_forces(RUN)

    assert all(len(each) == 1 for each in column(tmp_path, blind, "/world/robot/springs", "colors"))
    assert column(tmp_path, blind, "/world/robot/motor_forces", "vectors") == []
