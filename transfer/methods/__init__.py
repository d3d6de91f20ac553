"""The methods of learning: one file and one row of the registry each."""
