"""What a board has to offer to the core. For people and type checkers: not needed on the board itself."""

from typing import Protocol


class Board(Protocol):
    """One motor with a channel of pulses, and sensors."""

    def pulses(self) -> tuple[int, int]:
        """Return how many pulses were counted, and the time of the last one in us."""
        ...

    def set_output(self, output: int) -> None:
        """Set the motor's voltage in thousandths of the supply, signed; 0 brakes."""
        ...

    def motion(self) -> tuple[int, int, int, int, int, int]:
        """Return acceleration (16384 a g) and rotation (131 a degree/s) along x, y, z; zeros without a sensor."""
        ...

    def battery_mv(self) -> int:
        """Return the battery's voltage; ``core.UNKNOWN_MV`` where it is not wired."""
        ...
