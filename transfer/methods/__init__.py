"""The methods of learning: one file each, one row each in the registry."""
