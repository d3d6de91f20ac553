"""What a board has to offer to the core. For people and type checkers: not needed on the board itself."""

from typing import Protocol


class Board(Protocol):
    """Motors with encoders, and sensors. A sensor that is missing or does not answer reads ``core.UNKNOWN``."""

    def encoder(self, motor: int) -> tuple[int, int]:
        """Return the signed count of edges and the time of the last one in us."""
        ...

    def set_output(self, motor: int, output: int) -> None:
        """Set a motor's voltage in thousandths of the supply, signed; 0 brakes."""
        ...

    def current_ma(self, motor: int) -> int:
        """Return a motor's current."""
        ...

    def temperature_dc(self, motor: int) -> int:
        """Return a motor's temperature in tenths of a degree."""
        ...

    def board_temperature_dc(self) -> int:
        """Return the board's temperature in tenths of a degree."""
        ...

    def acceleration_mg(self) -> tuple[int, int, int]:
        """Return the board's acceleration along x, y, z in thousandths of g."""
        ...
