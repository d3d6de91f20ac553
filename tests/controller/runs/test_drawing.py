"""The log as other programs draw it: Foxglove's published schemas, and a robot in the bare log in Rerun."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from foxglove_schemas_protobuf.FrameTransform_pb2 import FrameTransform
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import make_reader
from PIL import Image
from sample_run import STRUCTURE, sample_run

from benchmarks.pictures import show_in_rerun
from vvvaltr.controller.core.records import LoggedTrial, Run
from vvvaltr.controller.core.values import Pose
from vvvaltr.controller.runs.log import LOG_NAME, RunLog
from vvvaltr.controller.runs.schema import drawing

RUN = sample_run(trials=2, poses=101)


def write(path: Path, run: Run) -> Path:
    with RunLog.create(path, run.structure, run.sources, run.about) as log:
        for logged in run.trials:
            log.append(logged)
    return path


def messages(path: Path, topic: str, kind: type) -> list:
    with path.open("rb") as file:
        return [kind.FromString(message.data) for _, _, message in make_reader(file).iter_messages(topics=[topic])]


def with_poses(logged: LoggedTrial, poses: tuple[Pose, ...]) -> LoggedTrial:
    return replace(logged, trial=replace(logged.trial, poses=poses))


@pytest.mark.parametrize(
    ("topic", "kind"), [("/robot/scene", SceneUpdate), ("/robot/points", PointCloud), ("/tf", FrameTransform)]
)
def test_the_schemas_are_those_that_foxglove_publishes(tmp_path: Path, topic: str, kind: type) -> None:
    with write(tmp_path / LOG_NAME, RUN).open("rb") as file:
        summary = make_reader(file).get_summary()
    (channel,) = (channel for channel in summary.channels.values() if channel.topic == topic)
    schema = summary.schemas[channel.schema_id]
    logged = {file.name: file for file in FileDescriptorSet.FromString(schema.data).file}
    published = type(next(iter(logged.values())))()
    kind.DESCRIPTOR.file.CopyToProto(published)

    assert schema.name == f"foxglove.{kind.__name__}"
    assert logged[published.name] == published


def test_the_transform_and_the_shape_put_each_strut_end_where_the_tracker_saw_it(tmp_path: Path) -> None:
    log = write(tmp_path / LOG_NAME, RUN)
    transform, shape = messages(log, "/tf", FrameTransform)[0], messages(log, "/robot/points", PointCloud)[0]
    pose = RUN.trials[0].trial.poses[0]
    points = np.frombuffer(shape.data, "<f4").reshape(-1, 3)
    x, y, z, w = (getattr(transform.rotation, axis) for axis in "xyzw")
    v = np.array([x, y, z])
    turned = points + 2.0 * np.cross(v, np.cross(v, points) + w * points)
    at = np.array([transform.translation.x, transform.translation.y, transform.translation.z])

    assert turned[0] + at == pytest.approx(np.array(pose.markers_m[STRUCTURE.struts[0][0]]), abs=1e-6)
    assert turned[-1] + at == pytest.approx(np.array(pose.markers_m[STRUCTURE.struts[-1][1]]), abs=1e-6)


def test_the_scene_holds_every_strut_and_spring(tmp_path: Path) -> None:
    struts, springs = messages(write(tmp_path / LOG_NAME, RUN), "/robot/scene", SceneUpdate)[0].entities[0].lines
    assert list(struts.indices) == [end for edge in STRUCTURE.struts for end in edge]
    assert list(springs.indices) == [end for edge in STRUCTURE.springs for end in edge]


def test_the_ground_is_drawn_once(tmp_path: Path) -> None:
    (ground,) = messages(write(tmp_path / LOG_NAME, RUN), "/ground", SceneUpdate)
    heights = [point.z for line in ground.entities[0].lines for point in line.points]
    assert max(heights) == pytest.approx(max(map(max, STRUCTURE.terrain.height_m)), abs=1e-3)


def test_a_robot_whose_strut_ends_nobody_sees_is_a_line_along_its_heading(tmp_path: Path) -> None:
    turned = Pose(0.0, (0.1, 0.2, 0.0), yaw_rad=math.pi / 2)
    run = Run(STRUCTURE, (), (with_poses(RUN.trials[0], (turned,)),))
    log = write(tmp_path / LOG_NAME, run)
    points = np.frombuffer(messages(log, "/robot/points", PointCloud)[0].data, "<f4").reshape(-1, 3)
    assert points[-1] == pytest.approx([0.06, 0.0, 0.0])
    assert messages(log, "/robot/scene", SceneUpdate) == []


@pytest.mark.parametrize(
    "pose", [Pose(0.0, (math.nan, 0.0, 0.0)), Pose(0.0, (0.0,) * 3, markers_m=((1e308, 0.0, 0.0),))]
)
def test_a_pose_that_no_viewer_could_place_is_not_drawn(tmp_path: Path, pose: Pose) -> None:
    lost = with_poses(RUN.trials[0], (pose,))
    assert messages(write(tmp_path / LOG_NAME, Run(STRUCTURE, (), (lost,))), "/tf", FrameTransform) == []


def test_a_log_grows_by_less_than_a_third(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = replace(RUN, structure=replace(STRUCTURE, terrain=None))
    drawn = write(tmp_path / "drawn.mcap", run).stat().st_size
    monkeypatch.setattr(drawing, "draw_trial", lambda *_: ())
    plain = write(tmp_path / "plain.mcap", run).stat().st_size
    assert plain < drawn < 4 / 3 * plain


def picture(log: Path, screenshot: Path) -> np.ndarray:
    """Return what Rerun shows of a file in its default layout, without a screen."""
    show_in_rerun(log, screenshot, (800, 600), patience_s=6.0)
    return np.asarray(Image.open(screenshot).convert("RGB")).astype(int)


def coloured_pixels(shown: np.ndarray) -> int:
    """Return the number of pixels in the middle of the window that have a colour of their own: its grid is grey."""
    middle = shown[60:540, 220:780]
    return int(np.sum(middle.max(axis=-1) - middle.min(axis=-1) > 60))


def test_rerun_draws_the_robot_of_a_bare_log(tmp_path: Path) -> None:
    unseen = replace(RUN, structure=None, trials=tuple(with_poses(logged, ()) for logged in RUN.trials))
    with_robot = picture(write(tmp_path / "robot.mcap", RUN), tmp_path / "robot.png")
    without = picture(write(tmp_path / "empty.mcap", unseen), tmp_path / "empty.png")

    assert coloured_pixels(without) == 0
    assert coloured_pixels(with_robot) > 100
