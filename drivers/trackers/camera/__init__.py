"""An overhead camera that sees an AprilTag on the robot (extra ``camera``: OpenCV, imported only where it is used)."""
