"""Finds good gaits for vibration-driven tensegrity robots, and carries what it learned to the next condition."""

from __future__ import annotations

__version__ = "0.2.0"
