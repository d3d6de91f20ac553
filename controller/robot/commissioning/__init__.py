"""What is done to a robot before it learns: checked, calibrated, its vibration measured."""
