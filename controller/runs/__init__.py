"""A run on disk: its folder, configuration, log and tables."""
