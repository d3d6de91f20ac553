"""Whether the causes of scatter are found in a run's own trials, and what that is worth."""
