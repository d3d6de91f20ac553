"""The lens from rendered views of the printed board, and what the printed pages measure."""

import re
import struct

import cv2
import numpy as np
import pytest

from vvvaltr.controller.core.errors import UserError
from vvvaltr.drivers.trackers.camera.board import BOARD_CELL_MM, BoardViews, board_cells, calibrated
from vvvaltr.drivers.trackers.camera.feed import LENS
from vvvaltr.drivers.trackers.camera.pictures import Looks, board_picture
from vvvaltr.drivers.trackers.camera.printing import board_page, png, svg, tag_pages
from vvvaltr.drivers.trackers.camera.tags import all_tags


def board_seen(tilt_rad, position_m, seed: int = 0) -> np.ndarray:
    rotation = cv2.Rodrigues(np.array(tilt_rad, float))[0]
    return board_picture(LENS, board_cells(), BOARD_CELL_MM / 1000.0, rotation, np.array(position_m), Looks(), seed)


def views_from_all_sides(count: int) -> BoardViews:
    random, views, seed = np.random.default_rng(3), BoardViews(), 0
    while len(views.views) < count:
        z_m = random.uniform(0.3, 0.5)
        seed += 1
        aside = random.uniform(-0.35, 0.35, 2) * [z_m, 0.5 * z_m]
        views.add(board_seen(random.uniform(-0.6, 0.6, 3), [*aside, z_m], seed))
    return views


def test_a_lens_is_found_from_views_of_the_board():
    found = calibrated(views_from_all_sides(10))
    assert found.lens.focal_px == pytest.approx(LENS.focal_px, rel=0.005)
    assert found.lens.centre_px == pytest.approx(LENS.centre_px, abs=5.0)
    assert found.error_px < 0.2
    edge = np.array([[100.0, 100.0], [1200.0, 650.0]])
    assert found.lens.rays(edge) == pytest.approx(LENS.rays(edge), abs=0.004)


def test_the_same_view_counts_once():
    views, picture = BoardViews(), board_seen((0.3, 0.0, 0.0), (0.0, 0.0, 0.4))
    assert [views.add(picture), views.add(picture)] == [True, False]


def test_a_picture_without_the_board_is_no_view():
    assert not BoardViews().add(np.full((720, 1280), 128, np.uint8))


def test_views_that_are_not_tilted_cannot_tell_the_lens():
    views = BoardViews()
    for step in range(6):
        views.add(board_seen((0.0, 0.0, 0.3 * step), (0.03 * step - 0.08, 0.0, 0.45), step))
    with pytest.raises(UserError, match="tilt the board by 30 degrees"):
        calibrated(views)


def test_tags_are_printed_at_their_true_size_with_a_ruler():
    (page,) = tag_pages([(5, 40.0, "robot")])
    text = svg(page)
    assert '<svg xmlns="http://www.w3.org/2000/svg" width="210mm" height="297mm" viewBox="0 0 210 297">' in text
    tag = [box for box in page.black if box[1] < 200.0]
    assert max(x + w for x, _, w, _ in tag) - min(x for x, _, _, _ in tag) == pytest.approx(40.0)
    assert re.search(r'<rect x="15.0000" y="275.0000" width="100.0000" height="0.3000"/>', text)


def test_a_printed_page_shows_the_tags_to_the_detector_and_says_its_resolution():
    pages = tag_pages([(5, 40.0, "robot"), *((number, 60.0, "floor") for number in range(10, 14))])
    seen = {}
    for page in pages:
        data = png(page)
        seen |= all_tags(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE), 100.0)
        assert struct.unpack(">II", data[data.index(b"pHYs") + 4 :][:8]) == (11811, 11811)
    assert sorted(seen) == [5, 10, 11, 12, 13]
    assert np.ptp(seen[5][:, 0]) == pytest.approx(40.0 * 300.0 / 25.4, abs=4.0)


def test_a_tag_that_is_larger_than_the_paper_is_refused():
    with pytest.raises(ValueError, match="a tag of 190 mm does not fit"):
        tag_pages([(0, 190.0, "robot")])


def test_the_printed_board_is_the_board_that_is_looked_for():
    page = png(board_page())
    printed = cv2.imdecode(np.frombuffer(page, np.uint8), cv2.IMREAD_GRAYSCALE)
    views = BoardViews()
    assert views.add(cv2.resize(printed, (1280, 905), interpolation=cv2.INTER_AREA))
    assert len(views.views[0].numbers) == 24
