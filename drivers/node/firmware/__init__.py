"""Firmware of the motor node: a pure core that runs on a board, in the mock and in tests, and thin shells around it."""
