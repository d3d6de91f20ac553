"""Random streams, each derived from what it is for; so a trial can be repeated alone and a run resumed exactly."""

from __future__ import annotations

import zlib

import numpy as np


def stream(seed: int, trial: int, purpose: str) -> np.random.Generator:
    """Return the generator for one purpose ("pose", "initial design", ...) of one trial of one seed (both >= 0)."""
    return np.random.default_rng([seed, trial, zlib.crc32(purpose.encode())])
