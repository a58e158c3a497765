"""Sets of beacons: refusals and their reasons, and layouts as one line of text."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bearing_sim import PAPER_BEACONS, PRESETS, Beacons, format_layout, parse_layout
from estimation.poses.beacon_plane import BeaconPlane
from quadrotor.errors import DegenerateGeometryError, MeasurementError

SQUARE = [[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]]
IDS = [1, 2, 3, 4]


def test_the_papers_beacons_form_a_square_of_two_metres_ten_centimetres_up() -> None:
    positions = PAPER_BEACONS.positions_w
    np.testing.assert_array_equal(positions[:, 2], 0.1)
    sides = np.linalg.norm(positions - np.roll(positions, 1, axis=0), axis=1)
    np.testing.assert_array_equal(sides, 2.0)
    np.testing.assert_allclose(PAPER_BEACONS.center_w, [0, 0, 0.1], atol=1e-16)
    np.testing.assert_allclose(PAPER_BEACONS.normal_w, [0, 0, 1], atol=1e-16)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_read_by_its_name_told_by_it_and_solvable(name: str) -> None:
    beacons = parse_layout(f" {name} ")
    assert format_layout(beacons) == name
    plane = BeaconPlane.of(beacons.positions_w, beacons.ids.tolist())
    assert plane.spanned
    assert abs(plane.axes[2] @ beacons.normal_w) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ("ids", "places", "kind", "says"),
    [
        (IDS[:3], SQUARE[:3], DegenerateGeometryError, "3 beacons; allowed are 4 to 32: add 1"),
        ([], np.zeros((0, 3)), DegenerateGeometryError, "0 beacons; allowed are 4 to 32: add 4"),
        (range(33), np.zeros((33, 3)), MeasurementError, "33 beacons.*leave out 1"),
        ([1, 2, 3, 3], SQUARE, MeasurementError, "id 3 appears more than once"),
        ([1, 2, 3, -1], SQUARE, MeasurementError, "id -1; allowed are 0 to 2147483647"),
        ([1, 2, 3, 2**31], SQUARE, MeasurementError, "id 2147483648; allowed are 0 to 2147483647"),
        ([1, 2, 3, 10**30], SQUARE, MeasurementError, "ids must be a sequence of integers"),
        ([1, 2, 3, 4.5], SQUARE, MeasurementError, "ids must be a sequence of integers"),
        (["1", "2", "3", "x"], SQUARE, MeasurementError, "ids must be a sequence of integers"),
        ([[1, 2, 3, 4]], SQUARE, MeasurementError, "ids must be a sequence of integers"),
        (IDS, SQUARE[:3], MeasurementError, r"\(3, 3\) for 4 ids"),
        (IDS, "here", MeasurementError, "not numbers"),
        (IDS, [*SQUARE[:3], [1, math.nan, 0.1]], MeasurementError, "beacon 4 stands at .*nan"),
        (IDS, [*SQUARE[:3], [1, math.inf, 0.1]], MeasurementError, "beacon 4 .*within ±1000 m"),
        (IDS, [*SQUARE[:3], [1000, -1001, 0.1]], MeasurementError, "give it in metres"),
        (
            IDS,
            [[k, 2 * k, 0.1] for k in range(4)],
            DegenerateGeometryError,
            "one line or at one point",
        ),
        (IDS, [[1, 2, 3]] * 4, DegenerateGeometryError, "one line or at one point"),
    ],
)
def test_what_is_no_set_of_beacons_is_refused_with_the_reason(
    ids: Any, places: Any, kind: type[MeasurementError], says: str
) -> None:
    with pytest.raises(MeasurementError, match=says) as refused:
        Beacons(ids, places)
    assert type(refused.value) is kind
    assert "\n" not in str(refused.value)


def test_a_set_cannot_be_changed_from_outside() -> None:
    given_places = np.array(SQUARE)
    beacons = Beacons(IDS, given_places)
    given_places[:] = 7.0
    np.testing.assert_array_equal(beacons.positions_w, SQUARE)
    with pytest.raises(ValueError, match="read-only"):
        beacons.positions_w[0, 0] = 5.0
    with pytest.raises(FrozenInstanceError):
        beacons.ids = np.zeros(4, np.int32)  # type: ignore[misc]


def test_moving_one_beacon_leaves_the_set_and_the_other_beacons() -> None:
    moved = PAPER_BEACONS.moved(2, (-0.5, 1.5, 0.1))
    assert moved.place(2) == (-0.5, 1.5, 0.1)
    assert PAPER_BEACONS.place(2) == (-1.0, 1.0, 0.1)
    assert all(moved.place(k) == PAPER_BEACONS.place(k) for k in (1, 3, 4))
    assert moved != PAPER_BEACONS
    assert moved.moved(2, PAPER_BEACONS.place(2)) == PAPER_BEACONS
    assert hash(moved.moved(2, PAPER_BEACONS.place(2))) == hash(PAPER_BEACONS)


@pytest.mark.parametrize(
    ("id", "place", "says"),
    [
        (9, (0, 0, 0.1), "no beacon 9; there are"),
        (1, (0, 0), "allowed are three numbers"),
        (1, "there", "allowed are three numbers"),
        (1, (0, math.nan, 0.1), "beacon 1 stands at"),
    ],
)
def test_a_move_that_leaves_no_set_is_refused(id: int, place: Any, says: str) -> None:
    with pytest.raises(MeasurementError, match=says):
        PAPER_BEACONS.moved(id, place)


def test_beacons_of_several_heights_are_a_set_with_the_plane_nearest_to_them() -> None:
    """Code that needs them in one plane refuses them; the error-state filter does not."""
    raised = PAPER_BEACONS.moved(1, (1.0, 1.0, 0.5))
    assert parse_layout(format_layout(raised)) == raised
    away = (raised.positions_w - raised.center_w) @ raised.normal_w
    assert np.abs(away).max() == pytest.approx(0.1, abs=0.02)
    with pytest.raises(DegenerateGeometryError, match="leave their common plane"):
        BeaconPlane.of(raised.positions_w)


coordinate = st.floats(-1000, 1000, allow_subnormal=False)


@given(
    st.lists(st.integers(0, 2**31 - 1), min_size=4, max_size=32, unique=True), st.data(), coordinate
)
def test_a_layout_is_read_back_to_the_last_bit(ids: list[int], data: Any, height: float) -> None:
    places = [(data.draw(coordinate), data.draw(coordinate), height) for _ in ids]
    try:
        beacons = Beacons(ids, places)
    except DegenerateGeometryError:
        return  # all on one line
    text = format_layout(beacons)
    assert "\n" not in text
    again = parse_layout(text)
    assert again == beacons
    assert format_layout(again) == text


@given(st.text(max_size=80))
@example(":" * 7 + "\U000101fe" * 60)
def test_any_other_text_is_refused_with_one_line(text: str) -> None:
    if text.strip() in PRESETS:
        return
    with pytest.raises(MeasurementError) as refused:
        parse_layout(text)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 300


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "layout '' is neither a preset .*write x y z in m"),
        ("papper", "did you mean paper"),
        ("1 1 1 .1; 2 -1 1", "beacon 2 of the layout is '2 -1 1'; allowed is 'id x y z'"),
        ("1 1 1 .1; 2 -1 one .1", "beacon 2 of the layout"),
        ("1.5 1 1 .1", "beacon 1 of the layout"),
        ("1 1 1 .1; 2 -1 1 .1; 3 -1 -1 .1", "3 beacons; allowed are 4 to 32"),
        ("1 1 1 .1; 1 -1 1 .1; 3 -1 -1 .1; 4 1 -1 .1", "id 1 appears more than once"),
    ],
)
def test_a_wrong_layout_is_refused_with_what_is_allowed(text: str, says: str) -> None:
    with pytest.raises(MeasurementError, match=says):
        parse_layout(text)


def test_a_set_as_large_and_as_precise_as_allowed_fits_the_text(rng: np.random.Generator) -> None:
    places = np.column_stack([rng.uniform(-1000, 1000, (32, 2)), np.full(32, -999.1234567890123)])
    beacons = Beacons(2**31 - 32 + np.arange(32), places)
    assert parse_layout(format_layout(beacons)) == beacons
    with pytest.raises(MeasurementError, match="layout of 4097 characters; allowed are 4096"):
        parse_layout("1" * 4097)


def test_commas_and_lines_and_a_last_semicolon_are_read_too() -> None:
    text = "1, 1, 1, .1\n2, -1, 1, .1; 3 -1 -1 .1;4 1 -1 1e-1;"
    assert parse_layout(text) == PAPER_BEACONS
