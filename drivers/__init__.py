"""Devices: a folder for each, with its table of the robot's file, its line, its bytes and its mock."""
