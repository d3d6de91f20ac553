"""What runs on the robot's companion computer: from the values that everything shares up to the command line."""
