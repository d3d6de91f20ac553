"""Pictures of the calibration board, as a camera of the mocks' lens takes them."""

from pathlib import Path

import cv2
import numpy as np

from vvvaltr.drivers.trackers.camera.board import BOARD_CELL_MM, board_cells
from vvvaltr.drivers.trackers.camera.feed import LENS
from vvvaltr.drivers.trackers.camera.pictures import Looks, board_picture


def write_board_views(folder: Path, count: int) -> None:
    """Write views of the board from different sides into a new folder."""
    random = np.random.default_rng(3)
    folder.mkdir()
    for number in range(count):
        z_m = random.uniform(0.3, 0.5)
        position_m = np.array([*(random.uniform(-0.3, 0.3, 2) * [z_m, 0.5 * z_m]), z_m])
        rotation = cv2.Rodrigues(random.uniform(-0.6, 0.6, 3))[0]
        picture = board_picture(LENS, board_cells(), BOARD_CELL_MM / 1000.0, rotation, position_m, Looks(), number)
        cv2.imwrite(str(folder / f"{number:02}.png"), picture)
