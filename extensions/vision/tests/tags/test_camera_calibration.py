"""The guide takes views of a board as a person moves it, and the intrinsics follow from them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from extensions.vision.tags.board_guide import ENOUGH_VIEWS, GOALS, BoardGuide
from extensions.vision.tags.board_print import POINTS_PER_MM, board_pdf
from extensions.vision.tags.camera_calibration import (
    COVERAGE_MIN,
    CameraCalibration,
    calibrate_camera,
)
from extensions.vision.tags.charuco import Board, BoardReader
from extensions.vision.tags.detector import Picture
from extensions.vision.tests.board_hand import BOARD, Hand, walk
from extensions.vision.tests.tags.rendered import MATRIX
from quadrotor.errors import MeasurementError


@pytest.fixture
def hand() -> Hand:
    return Hand(BoardGuide(BOARD), np.random.default_rng(3))


@pytest.fixture(scope="module")
def walked() -> BoardGuide:
    return walk()


def test_whoever_follows_the_guide_gets_the_intrinsics(walked: BoardGuide) -> None:
    found = walked.result()
    assert len(walked.views) >= ENOUGH_VIEWS
    assert found.warnings == ()
    assert found.residual < 0.2
    assert found.coverage > 0.8
    assert len(found.corners) > 150
    assert abs(found.matrix[0] - 600.0) < max(1.5, 4.0 * found.focal_deviation)
    np.testing.assert_allclose(found.intrinsics.matrix, MATRIX, atol=3.0)
    assert walked.state()["share"] == 1.0
    assert all(walked.state()["goals"].values())


def test_a_view_is_taken_when_the_board_is_still_and_only_once(hand: Hand) -> None:
    guide = hand._guide
    assert not hand.hold("place-1-1", shake=8.0)  # pixels between two pictures
    assert guide.hint == "Hold the board still"
    assert not hand.hold("place-1-1", shown=2)  # for too short a time
    assert hand.hold("place-1-1")
    assert not hand.hold("place-1-1", shown=12)  # adds nothing
    assert len(guide.views) == 1
    assert hand.hold("left")


@pytest.mark.parametrize("key", ["left", "right", "upper", "lower", "near", "far", "place-2-0"])
def test_each_goal_is_fulfilled_by_what_its_words_ask_for(hand: Hand, key: str) -> None:
    words = {goal.key: goal.words for goal in GOALS}[key]
    assert words
    assert not hand._guide.state()["goals"][key]
    assert hand.hold(key)
    assert hand._guide.state()["goals"][key]
    others = {"left": "right", "right": "left", "upper": "lower", "lower": "upper"}
    assert not hand._guide.state()["goals"][others.get(key, "place-0-2")]


def test_the_cells_of_the_picture_fill_where_the_board_was(hand: Hand) -> None:
    hand.hold("place-0-0")
    cells = np.array(hand._guide.state()["cells"])
    assert cells[:2, :3].all()
    assert not cells[:, 5:].any()


def test_too_few_views_little_of_the_picture_and_flat_views_are_told(walked: BoardGuide) -> None:
    size = (640, 480)
    with pytest.raises(MeasurementError, match="in 3 pictures, 8 are needed"):
        calibrate_camera(walked.views[:3], size)
    found = walked.result()
    assert [*_numbers(replace(found, coverage=0.3).warnings)] == [30, 100 * COVERAGE_MIN]
    assert "bends" in replace(found, residual=1.7).warnings[0]
    assert "tilt the board more" in replace(found, focal_deviation=9.0).warnings[0]


def _numbers(warnings: tuple[str, ...]) -> Iterator[float]:
    for warning in warnings:
        yield from map(float, re.findall(r"[\d.]+(?=%)", warning))


def test_a_picture_of_another_size_is_refused() -> None:
    guide = BoardGuide(BOARD)
    guide.look(np.full((480, 640), 128, np.uint8), 0)
    with pytest.raises(MeasurementError, match="320 x 240 pixels after those of 640 x 480"):
        guide.look(np.full((240, 320), 128, np.uint8), 1)


@pytest.mark.parametrize(("level", "told"), [(3, "black"), (250, "white"), (128, "No board")])
def test_a_picture_without_a_board_says_why(level: int, told: str) -> None:
    guide = BoardGuide(BOARD)
    assert not guide.look(np.full((480, 640), level, np.uint8), 0)
    assert told in guide.hint


def _printed(board: Board) -> Picture:
    """Return a photograph of a board, seen straight from the front."""
    picture = board.picture(60)
    return np.pad(picture, 40, constant_values=255)


@pytest.mark.parametrize(
    ("real", "told"),
    [
        (BOARD, ""),
        (replace(BOARD, columns=9, rows=7), r"Marker 30 is seen, .* only 0 to 16"),
        (replace(BOARD, columns=5), "not where a board of 7 x 5 squares has them"),
        (replace(BOARD, marker=0.025), r"0\.[45]\d of a square wide, but 0\.74"),
    ],
)
def test_a_board_of_other_dimensions_than_given_is_told(real: Board, told: str) -> None:
    view, problem = BoardReader(BOARD).read(_printed(real))
    assert re.search(told, problem)
    assert (view is not None) == (told == "") == (problem == "")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"columns": 2}, "2 x 5 squares"),
        ({"columns": 30, "rows": 30}, "450 markers"),
        ({"square": 5.0}, "5000 mm"),
        ({"marker": 0.06}, "60 mm in squares of 50 mm"),
    ],
)
def test_dimensions_that_no_board_has_are_refused(change: dict[str, float], told: str) -> None:
    with pytest.raises(MeasurementError, match=told):
        replace(BOARD, **change)  # type: ignore[arg-type]


def test_the_page_to_be_printed_has_the_board_at_its_true_size() -> None:
    board, scale = Board(), 4  # pixels for a mm
    text = board_pdf(board)
    width, height = (
        float(one) / POINTS_PER_MM for one in re.findall(r"0 0 ([\d.]+) ([\d.]+)\]", text)[0]
    )
    assert (round(width), round(height)) == (297, 210)
    picture = np.full((round(height * scale), round(width * scale)), 255, np.uint8)
    for line in re.findall(r"(.+) re\b", text):
        x, y, w, h = map(float, line.split())
        rows = slice(round((height - y - h) * scale), round((height - y) * scale))
        picture[rows, round(x * scale) : round((x + w) * scale)] = 0
    view, problem = BoardReader(board).read(picture)
    assert problem == ""
    assert view is not None
    assert len(view.numbers) == 6 * 4
    side = view.pixels[6] - view.pixels[0]
    np.testing.assert_allclose(side, (0.0, 35.0 * scale), atol=0.5)
    [ruler] = re.findall(r"^([\d.]+) ([\d.]+) m ([\d.]+) \2 l S$", text, re.MULTILINE)[:1]
    assert float(ruler[2]) - float(ruler[0]) == pytest.approx(100.0)
    assert int(re.findall(r"startxref\n(\d+)", text)[0]) == text.index("xref\n0 6")


def test_a_board_that_fits_no_paper_is_refused() -> None:
    assert "A3" in board_pdf(Board(square=0.05, marker=0.037))
    with pytest.raises(MeasurementError, match="larger than A0"):
        board_pdf(Board(square=0.3, marker=0.2))


def test_the_result_is_plain_data() -> None:
    found = CameraCalibration(
        4, 2, (2.0, 0, 2, 0, 3, 1, 0, 0, 1), (0.1, 0, 0, 0, 0), 0.2, 0.5, 9, 0.1, (), 0.3
    )
    assert found.focal_lengths == (2.0, 3.0)
    assert found.intrinsics.matrix.tolist() == [[2, 0, 2], [0, 3, 1], [0, 0, 1]]
