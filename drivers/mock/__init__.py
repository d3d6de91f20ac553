"""The devices themselves, for want of the real ones: they answer on a line, and move a twin in real time."""
