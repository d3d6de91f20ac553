"""Campaigns: the thesis' experiments over many repeats, their statistics and their report."""
