"""Campaigns of learning: the thesis' experiments, repeated until chance is ruled out, and what they show."""
