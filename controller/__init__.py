"""What runs on the robot: types, protocols, the trial loop and its safety, the log, and the command line."""
