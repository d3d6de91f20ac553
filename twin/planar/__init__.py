"""The twin in a vertical plane (pymunk), light enough for the robot's own computer."""
