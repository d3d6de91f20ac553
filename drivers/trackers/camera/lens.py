"""What a lens does to a picture, and how to undo it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vvvaltr.controller.core.arrays import Array


@dataclass(frozen=True, slots=True)
class Lens:
    """A pinhole with Brown's distortion, in OpenCV's terms (its page "Camera Calibration and 3D Reconstruction").

    Args:
        width_px, height_px: size of the pictures that it was calibrated for.
        focal_px: focal lengths along x and y.
        centre_px: where the optical axis meets the picture.
        distortion: k1, k2, p1, p2, k3, or fewer; empty for none.
    """

    width_px: int
    height_px: int
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...] = ()

    @property
    def matrix(self) -> Array:
        """The camera matrix, shape (3, 3)."""
        (fx, fy), (cx, cy) = self.focal_px, self.centre_px
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    def rays(self, pixels: Array) -> Array:
        """Return the straight rays through ``pixels``, shape (n, 2): x and y at the distance 1 of a pinhole, (n, 2)."""
        import cv2

        rays = cv2.undistortPoints(pixels.reshape(-1, 1, 2), self.matrix, self._coefficients)
        return np.asarray(rays, dtype=np.float64).reshape(-1, 2)

    def pixels(self, points: Array) -> Array:
        """Return where points in the camera's frame, shape (n, 3), are seen: (n, 2)."""
        import cv2

        nothing = np.zeros(3)
        seen, _ = cv2.projectPoints(points.reshape(-1, 1, 3), nothing, nothing, self.matrix, self._coefficients)
        return np.asarray(seen, dtype=np.float64).reshape(-1, 2)

    @property
    def _coefficients(self) -> Array:
        coefficients = np.zeros(5)
        coefficients[: len(self.distortion)] = self.distortion
        return coefficients
