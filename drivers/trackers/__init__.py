"""Trackers: where the robot is, one file per kind."""
