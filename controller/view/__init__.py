"""What is looked at: a run in Rerun, while it is made or afterwards."""
