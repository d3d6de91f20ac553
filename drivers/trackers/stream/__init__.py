"""Poses as JSON over UDP, from any program that can send them."""
