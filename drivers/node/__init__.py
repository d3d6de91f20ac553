"""The motor node, our own closed-loop device on a serial line, with its firmware."""
