"""Devices: one file per protocol and one per transport."""
