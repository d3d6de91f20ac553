"""What a camera over a twin sees: floor, floor tags and the robot's tag in perspective, through a lens, in bad light.

Only the robot's card is drawn anew for each picture, three times as fine as the picture; all else is still.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vvvaltr.controller.core.arrays import Array
from vvvaltr.controller.core.streams import stream
from vvvaltr.controller.core.values import Pose, Vector
from vvvaltr.drivers.trackers.camera.lens import Lens
from vvvaltr.drivers.trackers.camera.sight import RobotTag
from vvvaltr.drivers.trackers.camera.tags import Picture, dictionary
from vvvaltr.drivers.trackers.camera.view import View

_MODULE_PX = 16  # of a card's texture
_TAG, _CARD = 8, 12  # modules: the black square, and the white card that it is printed on
_FINE = 3  # how much finer than the picture the card is drawn
_BLACK, _WHITE, _FLOOR, _HAND, _STRUT = 30.0, 215.0, 140.0, 120, 60
_NOISE_MARGIN_PX = 64

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Looks:
    """What is bad about the pictures.

    Args:
        blur_px: standard deviation of the lens' blur.
        noise: standard deviation of the sensor's noise, as a share of white.
        exposure_s: how long the shutter is open.
        unevenness: share of the light that is missing in the darkest corner.
    """

    blur_px: float = 1.5
    noise: float = 0.02
    exposure_s: float = 0.004
    unevenness: float = 0.4


class Painter:
    """Draws pictures.

    Args:
        view: the camera.
        tag: the robot's; its height is that of the robot's centre at rest.
        floor_m: x and y of the centre of each floor tag.
        floor_size_m: the side of a floor tag.
        looks: what is bad about the pictures.
        seed: of the noise.
    """

    def __init__(
        self,
        view: View,
        tag: RobotTag,
        floor_m: Mapping[int, tuple[float, float]] | None = None,
        floor_size_m: float = 0.06,
        looks: Looks | None = None,
        seed: int = 0,
    ) -> None:
        self._view, self._tag, self._looks = view, tag, looks or Looks()
        self._random = stream(seed, 0, "pictures")
        self._slopes = _slopes(view)
        self._light = self._uneven_light()
        self._card = _card(tag.id)
        self._still = self._floor(floor_m or {}, floor_size_m)
        self._noise = self._noise_bank()

    def picture(
        self,
        pose: Pose | None,
        velocity_m_s: Vector = (0.0, 0.0, 0.0),
        struts: Sequence[tuple[int, int]] = (),
        hand_m: tuple[float, float] | None = None,
    ) -> Picture:
        """Return one picture, shape (height, width).

        Args:
            pose: the robot in the middle of the exposure; None for an empty floor.
            velocity_m_s: of the robot, which blurs it.
            struts: pairs of indices into the pose's markers, to be drawn.
            hand_m: where above the ground a hand is held; None for no hand.
        """
        picture = self._still.copy()
        if pose is not None:
            self._draw_struts(picture, pose, struts)
            self._draw_card(picture, pose, velocity_m_s)
        if hand_m is not None:
            self._draw_hand(picture, hand_m)
        return self._with_noise(picture)

    def _uneven_light(self) -> Floats:
        height, width = self._slopes.shape[:2]
        y, x = np.mgrid[0:height, 0:width].astype(np.float32)
        away = np.hypot(x / width - 0.3, y / height - 0.4)
        return np.asarray(1.0 - self._looks.unevenness * (away / away.max()) ** 2, np.float32)

    def _floor(self, floor_m: Mapping[int, tuple[float, float]], size_m: float) -> Picture:
        import cv2

        height, width = self._slopes.shape[:2]
        grain = cv2.GaussianBlur(self._random.normal(0.0, 25.0, (height, width)).astype(np.float32), (0, 0), 3.0)
        floor = _FLOOR + grain
        for number, (x_m, y_m) in floor_m.items():
            pose = Pose(0.0, (x_m, y_m, 0.0))
            _lay(floor, *self._drawn(_card(number), pose, size_m, (0.0, 0.0)))
        return np.asarray(np.clip(floor * self._light, 0.0, 255.0), np.uint8)

    def _noise_bank(self) -> NDArray[np.int16]:
        height, width = self._slopes.shape[:2]
        shape = (height + _NOISE_MARGIN_PX, width + _NOISE_MARGIN_PX)
        return np.round(self._random.normal(0.0, 255.0 * self._looks.noise, shape)).astype(np.int16)

    def _with_noise(self, picture: Picture) -> Picture:
        import cv2

        if self._looks.noise == 0.0:
            return picture
        top, left = self._random.integers(0, _NOISE_MARGIN_PX, 2).tolist()
        height, width = picture.shape
        noise = self._noise[top : top + height, left : left + width]
        return np.asarray(cv2.add(picture, noise, dtype=cv2.CV_8U), dtype=np.uint8)

    def _draw_card(self, picture: Picture, pose: Pose, velocity_m_s: Vector) -> None:
        ahead = np.array(pose.position_m) + self._looks.exposure_s * np.array(velocity_m_s)
        here, there = self._view.pixels(np.array([pose.position_m, ahead]))
        drawn, corner = self._drawn(self._card, pose, self._tag.size_m, tuple((there - here).tolist()))
        if drawn.size:
            top, left = corner
            window = (slice(top, top + drawn.shape[0]), slice(left, left + drawn.shape[1]))
            patch = picture[window].astype(np.float32)
            lit = drawn[..., 0] * self._light[window] + (1.0 - drawn[..., 1]) * patch
            picture[window] = np.clip(lit, 0.0, 255.0).astype(np.uint8)

    def _drawn(
        self, card: Floats, pose: Pose, size_m: float, smear_px: tuple[float, float]
    ) -> tuple[Floats, tuple[int, int]]:
        """Return a card's brightness and cover, shape (rows, columns, 2), and the row and column where it lies."""
        import cv2

        half_m = size_m * _CARD / _TAG / 2.0
        axes = _axes(pose)
        corners = np.array(pose.position_m) + half_m * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) @ axes[:2]
        margin = math.ceil(3.0 * self._looks.blur_px + math.hypot(*smear_px)) + 3
        window = self._window(self._view.pixels(corners), margin)
        slopes = self._slopes[window]
        if not slopes.size:
            return np.zeros((0, 0, 2), np.float32), (0, 0)
        fine = cv2.resize(slopes, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_LINEAR)
        x, y = self._on_card(np.asarray(fine, np.float32), pose, axes, size_m / _TAG)
        drawn = cv2.remap(card, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        if math.hypot(*smear_px) > 0.05:
            drawn = cv2.filter2D(drawn, -1, _smear(_FINE * smear_px[0], _FINE * smear_px[1]))
        if self._looks.blur_px > 0.0:
            drawn = cv2.GaussianBlur(drawn, (0, 0), _FINE * self._looks.blur_px)
        coarse = cv2.resize(drawn, (slopes.shape[1], slopes.shape[0]), interpolation=cv2.INTER_AREA)
        return np.asarray(coarse, np.float32), (window[0].start, window[1].start)

    def _window(self, corners_px: Array, margin: int) -> tuple[slice, slice]:
        height, width = self._slopes.shape[:2]
        low, high = corners_px.min(axis=0) - margin, corners_px.max(axis=0) + margin + 1
        left, right = np.clip([low[0], high[0]], 0, width).astype(int).tolist()
        top, bottom = np.clip([low[1], high[1]], 0, height).astype(int).tolist()
        return slice(top, bottom), slice(left, right)

    def _on_card(self, slopes: Floats, pose: Pose, axes: Array, module_m: float) -> tuple[Floats, Floats]:
        """Return which place of the card's texture each ray meets: x and y in the texture's pixels."""
        camera = self._view.position_m - np.array(pose.position_m)
        # The ray is camera + s (slope, 1); it meets the card's plane where its share along the normal is nothing.
        right, up, normal = axes.astype(np.float32)
        height, rx, uy = (np.float32(axis @ camera) for axis in (axes[2], axes[0], axes[1]))
        reach = -height / (slopes[..., 0] * normal[0] + slopes[..., 1] * normal[1] + normal[2])
        px_m, middle = np.float32(_MODULE_PX / module_m), np.float32(_CARD * _MODULE_PX / 2.0 - 0.5)
        x = rx + reach * (slopes[..., 0] * right[0] + slopes[..., 1] * right[1] + right[2])
        y = uy + reach * (slopes[..., 0] * up[0] + slopes[..., 1] * up[1] + up[2])
        return middle + px_m * x, middle - px_m * y

    def _draw_struts(self, picture: Picture, pose: Pose, struts: Sequence[tuple[int, int]]) -> None:
        import cv2

        if not (struts and pose.markers_m):
            return
        ends = np.round(16.0 * self._view.pixels(np.array(pose.markers_m))).astype(int)
        for first, second in struts:
            cv2.line(picture, ends[first].tolist(), ends[second].tolist(), (_STRUT,), 5, cv2.LINE_AA, shift=4)

    def _draw_hand(self, picture: Picture, hand_m: tuple[float, float]) -> None:
        """Draw a palm over the place, four fingers and the arm that comes from the picture's lower edge."""
        import cv2

        scale = self._view.side_px(1.0, 0.1)
        x, y = np.round(self._view.pixels(np.array([[*hand_m, 0.1]]))[0]).astype(int).tolist()
        thick = max(2, round(0.018 * scale))
        for finger in range(-1, 3):
            tip = (x + round(0.03 * scale * finger), y - round((0.085 - 0.006 * finger**2) * scale))
            cv2.line(picture, (x + round(0.02 * scale * finger), y), tip, (_HAND,), thick, cv2.LINE_AA)
        cv2.line(picture, (x, y), (x, picture.shape[0]), (_HAND,), round(0.055 * scale), cv2.LINE_AA)
        cv2.ellipse(picture, (x, y), (round(0.05 * scale), round(0.06 * scale)), 0, 0, 360, (_HAND,), -1, cv2.LINE_AA)


def _slopes(view: View) -> Floats:
    """Return how far each pixel's ray goes along x and y for each metre that it rises, shape (height, width, 2)."""
    width, height = view.lens.width_px, view.lens.height_px
    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    rays = view.lens.rays(np.column_stack([x.ravel(), y.ravel()]))
    directions = np.column_stack([rays, np.ones(len(rays))]) @ view.rotation
    return (directions[:, :2] / directions[:, 2:]).reshape(height, width, 2).astype(np.float32)


def _card(number: int) -> Floats:
    """Return a card's brightness and cover as a texture, shape (side, side, 2)."""
    import cv2

    tag = cv2.aruco.generateImageMarker(dictionary(), number, _TAG)
    modules = np.pad(tag, (_CARD - _TAG) // 2, constant_values=255)
    brightness = np.where(modules > 127, _WHITE, _BLACK).repeat(_MODULE_PX, 0).repeat(_MODULE_PX, 1)
    return np.dstack([brightness, np.ones_like(brightness)]).astype(np.float32)


def _axes(pose: Pose) -> Array:
    """Return the robot's axes (forward, left, up) in the world, one a row, from its intrinsic z-y'-x'' angles."""
    (cz, sz), (cy, sy), (cx, sx) = (
        (math.cos(angle), math.sin(angle)) for angle in (pose.yaw_rad, pose.pitch_rad, pose.roll_rad)
    )
    return np.array(
        [
            [cz * cy, sz * cy, -sy],
            [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
            [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
        ]
    )


def _lay(floor: Floats, drawn: Floats, corner: tuple[int, int]) -> None:
    top, left = corner
    patch = floor[top : top + drawn.shape[0], left : left + drawn.shape[1]]
    patch *= 1.0 - drawn[..., 1]
    patch += drawn[..., 0]


def _smear(x_px: float, y_px: float) -> Floats:
    """Return the kernel of a straight motion, its centroid in the middle."""
    reach = math.ceil(max(abs(x_px), abs(y_px)) / 2.0) + 1
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 33):
        x, y = reach + share * x_px, reach + share * y_px
        column, row = math.floor(x), math.floor(y)
        for i, j, weight in (
            (row, column, (1 - y + row) * (1 - x + column)),
            (row, column + 1, (1 - y + row) * (x - column)),
            (row + 1, column, (y - row) * (1 - x + column)),
            (row + 1, column + 1, (y - row) * (x - column)),
        ):
            kernel[i, j] += weight
    return np.asarray(kernel / kernel.sum())


def board_picture(
    lens: Lens, sheet: Picture, cell_m: float, rotation: Array, position_m: Array, looks: Looks, seed: int = 0
) -> Picture:
    """Return what a camera sees of a printed sheet that is held before it.

    Args:
        lens: the camera's.
        sheet: the print, in cells of ``cell_m``.
        cell_m: the side of a cell.
        rotation: from the sheet's axes (x right, y down) to the camera's, shape (3, 3).
        position_m: of the sheet's middle in the camera's frame, shape (3,).
        looks: what is bad about the picture.
        seed: of its noise.
    """
    import cv2

    y, x = np.mgrid[0 : lens.height_px, 0 : lens.width_px].astype(np.float64)
    rays = lens.rays(np.column_stack([x.ravel(), y.ravel()]))
    plane = np.column_stack([rotation[:, 0], rotation[:, 1], position_m])
    met = np.column_stack([rays, np.ones(len(rays))]) @ np.linalg.inv(plane).T
    cells = np.asarray(met[:, :2] / met[:, 2:] / cell_m + np.array(sheet.shape[::-1]) / 2.0 - 0.5, np.float32)
    places = cells.reshape(lens.height_px, lens.width_px, 2)
    paper = _BLACK + (_WHITE - _BLACK) / 255.0 * cv2.GaussianBlur(sheet.astype(np.float32), (0, 0), 1.0)
    margin = 12.0 / 1000.0 / cell_m
    on_paper = ((places > -margin) & (places < np.array(sheet.shape[::-1]) + margin)).all(axis=2)
    seen = cv2.remap(paper, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderValue=_WHITE)
    scene = np.where(on_paper & (met[:, 2].reshape(on_paper.shape) > 0.0), seen, _FLOOR).astype(np.float32)
    noise = stream(seed, 0, "pictures").normal(0.0, 255.0 * looks.noise, scene.shape)
    return np.asarray(np.clip(cv2.GaussianBlur(scene, (0, 0), looks.blur_px) + noise, 0.0, 255.0), np.uint8)
