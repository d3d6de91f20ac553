"""One trial and the loop of trials: runner, safety, scoring, learning. Knows protocols, never a device or a file."""
