"""A camera makes pictures only while a page shows them, and figures always."""

from __future__ import annotations

import math

import numpy as np
import pytest

from console.trackers.camera_figures import Figures, figures_text
from extensions.vision.tracker import camera_view
from extensions.vision.tracker.camera_view import CameraView

GREY = np.full((48, 64), 120, np.uint8)
TAGS = {3: np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 30.0], [10.0, 30.0]])}
MS = 1_000_000


def test_pictures_are_made_only_while_somebody_looks_and_ten_times_a_second_at_most() -> None:
    view = CameraView()
    for k in range(60):
        view.add(k * 20 * MS, GREY, TAGS, {3}, 0.2)
    made = {view.newest}
    assert made == {None}
    view.is_watched = True
    for k in range(60, 110):  # 1 s at 50 Hz
        view.add(k * 20 * MS, GREY, TAGS, {3}, 0.2)
        made.add(view.newest)
    assert 8 <= len(made - {None}) <= 11


def test_figures_are_of_the_last_second(monkeypatch: pytest.MonkeyPatch) -> None:
    view = CameraView()
    for k in range(100):  # 2 s at 50 Hz, the first of which is black
        dark = k < 50
        view.add(
            k * 20 * MS, GREY * (not dark), {} if dark else TAGS, {3}, math.nan if k % 2 else 0.25
        )
    monkeypatch.setattr(camera_view, "monotonic_ns", lambda: 99 * 20 * MS)
    figures = view.figures()
    assert figures.picture_rate == pytest.approx(50, abs=1)
    assert figures.tags_share > 0.97
    assert (figures.grey_level, figures.residual) == (120.0, 0.25)
    monkeypatch.setattr(camera_view, "monotonic_ns", lambda: 4_000 * MS)
    assert figures_text(view.figures()) == "no pictures"


def test_the_words_tell_a_black_picture_the_camera_and_what_it_looks_for() -> None:
    black = Figures("", 30.0, 0.0, 3.2, math.nan)
    assert figures_text(black) == (
        "30 pictures/s, mean grey level 3 of 255 (black), tags in 0% of them"
    )
    good = Figures("left", 29.7, 0.98, 121.0, 0.214)
    assert figures_text(good, "beacons") == (
        "camera left: 30 pictures/s, mean grey level 121 of 255, beacons in 98% of them, "
        "0.21 pixels from their places"
    )
