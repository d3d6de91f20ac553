"""The Pololu qik 2s9v1, the published robot's motor controller, on a serial line."""
