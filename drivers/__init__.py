"""Devices: one folder each, with its table of the robot's file, its line, its protocol and its mock."""
