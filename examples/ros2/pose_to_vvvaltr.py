"""A ROS 2 node that sends geometry_msgs/PoseStamped to vvvaltr: ros2 run, or python3 pose_to_vvvaltr.py.

Parameters: topic (/robot/pose), host (127.0.0.1), port (5005). Frames as in REP 103: x forward, z up, metres.
"""

import json
import math
import socket


def datagram(sequence, message):
    """Return the datagram for a geometry_msgs/PoseStamped."""
    stamp, place, turn = message.header.stamp, message.pose.position, message.pose.orientation
    x, y, z, w = turn.x, turn.y, turn.z, turn.w
    pose = {
        "sequence": sequence,
        "t_s": stamp.sec + 1e-9 * stamp.nanosec,
        "position_m": [place.x, place.y, place.z],
        "yaw_rad": math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        "pitch_rad": math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x)))),
        "roll_rad": math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
    }
    return json.dumps(pose).encode()


def main():
    """Send what comes until the node is shut down."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.qos import qos_profile_sensor_data

    rclpy.init()
    node, wire, count = rclpy.create_node("pose_to_vvvaltr"), socket.socket(socket.AF_INET, socket.SOCK_DGRAM), [0]
    topic, host, port = (node.declare_parameter(*default).value for default in DEFAULTS)

    def send(message):
        count[0] += 1
        wire.sendto(datagram(count[0], message), (host, port))

    node.create_subscription(PoseStamped, topic, send, qos_profile_sensor_data)
    rclpy.spin(node)


DEFAULTS = (("topic", "/robot/pose"), ("host", "127.0.0.1"), ("port", 5005))

if __name__ == "__main__":
    main()
