"""The causes of a robot's scatter, found in a run's own trials: the floor, strength, motors that stand still."""
