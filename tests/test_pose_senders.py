"""The senders of poses in the documentation and the examples, without ROS."""

import importlib.util
import re
import socket
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from moving import is_pose, until

from vvvaltr.drivers.trackers.attitude import quaternion_of
from vvvaltr.drivers.trackers.stream.message import decode_pose
from vvvaltr.drivers.trackers.stream.table import StreamTable
from vvvaltr.drivers.trackers.stream.tracker import StreamTracker

ROOT = Path(__file__).parent.parent


def ros_node():
    spec = importlib.util.spec_from_file_location("pose_to_vvvaltr", ROOT / "examples/ros2/pose_to_vvvaltr.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stamped(position_m, angles):
    """A geometry_msgs/PoseStamped, as far as the node looks at it."""
    axes = ("x", "y", "z", "w")
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=12, nanosec=500_000_000)),
        pose=SimpleNamespace(
            position=SimpleNamespace(**dict(zip(axes, position_m, strict=False))),
            orientation=SimpleNamespace(**dict(zip(axes, quaternion_of(angles), strict=True))),
        ),
    )


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (3.0, 0.2, -0.1), (-2.0, -1.5, 3.0)])
def test_the_ros_node_sends_what_the_tracker_understands(angles):
    told = decode_pose(ros_node().datagram(7, stamped((0.1, -0.2, 0.03), angles)))

    pose = told.pose
    assert (told.sequence, pose.t_s, pose.position_m) == (7, 12.5, (0.1, -0.2, 0.03))
    assert (pose.yaw_rad, pose.pitch_rad, pose.roll_rad) == pytest.approx(angles)


def test_the_ros_node_never_sends_what_is_no_number_as_a_pose():
    told = decode_pose(ros_node().datagram(7, stamped((float("nan"), 0.0, 0.0), (0.0, 0.0, 0.0))))
    assert told.pose is None and told.missing == "position_m"


def test_the_ros_node_forwards_what_it_subscribes_to(monkeypatch):
    """With a stand-in for ROS that has what the node calls, and delivers one message."""
    tracker = StreamTracker(StreamTable(port=0))
    host, port = tracker.address.split(":")
    asked = {"topic": "/wand/pose", "host": host, "port": int(port)}
    subscribed, wires = {}, []
    node = SimpleNamespace(
        declare_parameter=lambda name, default: SimpleNamespace(value=asked[name]),
        create_subscription=lambda kind, topic, callback, qos: subscribed.update({topic: callback}),
    )
    rclpy = SimpleNamespace(
        init=lambda: None,
        create_node=lambda name: node,
        spin=lambda node: subscribed["/wand/pose"](stamped((0.1, 0.2, 0.3), (0.5, 0.0, 0.0))),
    )
    for name, module in {
        "rclpy": rclpy,
        "rclpy.qos": SimpleNamespace(qos_profile_sensor_data=None),
        "geometry_msgs": SimpleNamespace(),
        "geometry_msgs.msg": SimpleNamespace(PoseStamped=object),
    }.items():
        monkeypatch.setitem(sys.modules, name, module)
    make = socket.socket
    monkeypatch.setattr(socket, "socket", lambda *kind: wires.append(make(*kind)) or wires[-1])

    ros_node().main()

    assert until(tracker, is_pose).yaw_rad == pytest.approx(0.5)
    tracker.close()
    wires[0].close()


def test_the_sender_in_the_documentation_works():
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/trackers.md").read_text(), re.DOTALL)
    assert len(code.strip().splitlines()) <= 10
    tracker = StreamTracker(StreamTable(port=0))
    looks = iter([(1.0, [0.1, 0.2, 0.03], 0.5), (1.01, [0.3, 0.2, 0.03], 0.6)])

    names = {"look": lambda: next(looks)}
    with pytest.raises(StopIteration):
        exec(code.replace("5005", tracker.address.split(":")[1]), names)

    pose = until(tracker, lambda seen: is_pose(seen) and seen.yaw_rad == 0.6)
    tracker.close()
    names["wire"].close()
    assert pose.position_m == (0.3, 0.2, 0.03)
