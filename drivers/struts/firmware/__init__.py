"""Firmware of a radio strut: a pure core that runs on a board, in the mock and in tests, and a thin radio shell."""
