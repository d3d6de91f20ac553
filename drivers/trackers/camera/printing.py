"""Tags and the calibration board on paper, at true size: SVG in millimetres, and PNG at 300 dots an inch."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from vvvaltr.drivers.trackers.camera.board import BOARD_CELL_MM, board_cells
from vvvaltr.drivers.trackers.camera.tags import Picture, dictionary

_MODULES = 8  # the side of a tag
_MARGIN = 2  # modules of white around it
_PAPER_MM = (210.0, 297.0)  # A4
_EDGE_MM, _GAP_MM, _FOOT_MM = 15.0, 12.0, 40.0
_RULER_MM = 100
_DOTS_PER_MM = 300.0 / 25.4

Box = tuple[float, float, float, float]  # x, y, width, height in mm


@dataclass(frozen=True, slots=True)
class Page:
    """What is printed on one sheet, in mm from its upper left corner.

    Args:
        width_mm, height_mm: of the sheet.
        black: filled boxes.
        outlines: boxes to cut along.
        texts: x, y of the lower left corner, and what is written.
    """

    width_mm: float
    height_mm: float
    black: list[Box] = field(default_factory=list)
    outlines: list[Box] = field(default_factory=list)
    texts: list[tuple[float, float, str]] = field(default_factory=list)


def tag_pages(tags: Sequence[tuple[int, float, str]]) -> list[Page]:
    """Return sheets with tags.

    Args:
        tags: id, side of the black square in mm, and what the tag is for.

    Raises:
        ValueError: a tag does not fit on a sheet of A4.
    """
    pages: list[Page] = []
    x_mm, y_mm, row_mm = 0.0, math.inf, 0.0
    for number, side_mm, purpose in tags:
        card_mm = side_mm * (_MODULES + 2 * _MARGIN) / _MODULES
        if card_mm > _PAPER_MM[0] - 2 * _EDGE_MM:
            raise ValueError(f"a tag of {side_mm:g} mm does not fit on a sheet of A4: print a smaller one")
        if x_mm + card_mm > _PAPER_MM[0] - _EDGE_MM:
            x_mm, y_mm, row_mm = _EDGE_MM, y_mm + row_mm + _GAP_MM, 0.0
        if y_mm + card_mm > _PAPER_MM[1] - _FOOT_MM:
            x_mm, y_mm, row_mm = _EDGE_MM, _EDGE_MM, 0.0
            pages.append(Page(*_PAPER_MM))
            _add_ruler(pages[-1])
        _add_tag(pages[-1], number, side_mm, (x_mm, y_mm))
        pages[-1].texts.append((x_mm, y_mm + card_mm + 4.5, f"tag {number}: {purpose}, {side_mm:g} mm"))
        x_mm, row_mm = x_mm + card_mm + _GAP_MM, max(row_mm, card_mm)
    return pages


def board_page() -> Page:
    """Return a sheet with the calibration board."""
    page = Page(_PAPER_MM[1], _PAPER_MM[0])
    cells = board_cells()
    width_mm, height_mm = (BOARD_CELL_MM * side for side in cells.shape[::-1])
    left_mm, top_mm = (page.width_mm - width_mm) / 2.0, _EDGE_MM
    page.black.extend(_boxes(cells < 128, BOARD_CELL_MM, (left_mm, top_mm)))
    page.texts.append((left_mm, top_mm + height_mm + 6.0, "Glue this onto something flat and stiff. Squares of 30 mm."))
    _add_ruler(page)
    return page


def _add_tag(page: Page, number: int, side_mm: float, corner_mm: tuple[float, float]) -> None:
    import cv2

    module_mm = side_mm / _MODULES
    cells = cv2.aruco.generateImageMarker(dictionary(), number, _MODULES) < 128
    x_mm, y_mm = (along + _MARGIN * module_mm for along in corner_mm)
    page.black.extend(_boxes(cells, module_mm, (x_mm, y_mm)))
    card_mm = side_mm + 2 * _MARGIN * module_mm
    page.outlines.append((*corner_mm, card_mm, card_mm))


def _add_ruler(page: Page) -> None:
    x_mm, y_mm = _EDGE_MM, page.height_mm - 22.0
    page.black.append((x_mm, y_mm, _RULER_MM, 0.3))
    for mark in range(0, _RULER_MM + 1, 5):
        page.black.append((x_mm + mark - 0.1, y_mm, 0.2, 5.0 if mark % 10 == 0 else 3.0))
    for mark in (0, 50, 100):
        page.texts.append((x_mm + mark - 1.0, y_mm + 9.0, str(mark)))
    page.texts.append((x_mm, y_mm + 14.0, "This ruler must be 100 mm long: print at 100 %, do not fit to the page."))


def _boxes(cells: NDArray[np.bool_], cell_mm: float, corner_mm: tuple[float, float]) -> Iterator[Box]:
    """Yield boxes that cover the true cells; equal runs of neighbouring rows are one box, without a seam."""
    x_mm, y_mm = corner_mm
    open_runs: dict[tuple[int, int], int] = {}  # run -> the row in which it began
    for row in range(len(cells) + 1):
        runs = set(_runs(cells[row])) if row < len(cells) else set()
        for begin, end in [run for run in open_runs if run not in runs]:
            top = open_runs.pop((begin, end))
            yield x_mm + begin * cell_mm, y_mm + top * cell_mm, (end - begin) * cell_mm, (row - top) * cell_mm
        for run in runs:
            open_runs.setdefault(run, row)


def _runs(row: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], row, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]


def svg(page: Page) -> str:
    """Return a page as SVG of its true size."""
    size = (
        f'width="{page.width_mm:g}mm" height="{page.height_mm:g}mm" viewBox="0 0 {page.width_mm:g} {page.height_mm:g}"'
    )
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" {size}>', '<rect width="100%" height="100%" fill="white"/>']
    lines.append('<g shape-rendering="crispEdges">')
    lines += [f'<rect x="{x:.4f}" y="{y:.4f}" width="{w:.4f}" height="{h:.4f}"/>' for x, y, w, h in page.black]
    lines.append('</g><g fill="none" stroke="#bbb" stroke-width="0.15">')
    lines += [f'<rect x="{x:.4f}" y="{y:.4f}" width="{w:.4f}" height="{h:.4f}"/>' for x, y, w, h in page.outlines]
    lines.append('</g><g font-family="sans-serif" font-size="3.5">')
    lines += [f'<text x="{x:.2f}" y="{y:.2f}">{escape(text)}</text>' for x, y, text in page.texts]
    return "\n".join([*lines, "</g>", "</svg>", ""])


def png(page: Page) -> bytes:
    """Return a page as PNG of 300 dots an inch, which the file says, so that it prints at its true size."""
    import cv2

    shape = (round(page.height_mm * _DOTS_PER_MM), round(page.width_mm * _DOTS_PER_MM))
    picture: Picture = np.full(shape, 255, np.uint8)
    for x, y, width, height in page.black:
        left, top, right, bottom = (round(_DOTS_PER_MM * edge) for edge in (x, y, x + width, y + height))
        picture[top : max(bottom, top + 1), left : max(right, left + 1)] = 0
    for x, y, width, height in page.outlines:
        left, top, right, bottom = (round(_DOTS_PER_MM * edge) for edge in (x, y, x + width, y + height))
        cv2.rectangle(picture, (left, top), (right, bottom), (187,), 2)
    for x, y, text in page.texts:
        place = (round(_DOTS_PER_MM * x), round(_DOTS_PER_MM * y))
        cv2.putText(picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 1.1, (0,), 2, cv2.LINE_AA)
    return _with_resolution(cv2.imencode(".png", picture)[1].tobytes())


def _with_resolution(data: bytes) -> bytes:
    """Return a PNG with the chunk that says how many dots a metre it has (PNG specification, 11.3.4.3 pHYs)."""
    dots_per_m = round(1000.0 * _DOTS_PER_MM)
    chunk = b"pHYs" + struct.pack(">IIB", dots_per_m, dots_per_m, 1)
    header_end = 8 + 25  # the signature and IHDR, after which the chunk may stand
    return data[:header_end] + struct.pack(">I", 9) + chunk + struct.pack(">I", zlib.crc32(chunk)) + data[header_end:]
