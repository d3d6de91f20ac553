"""Steering with tried gaits: what each one does to place and heading, and how to get somewhere with them."""
