"""Preparation, done once, of a set of beacons, and refusals of unsuitable sets."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from estimation.poses.beacon_plane import BeaconPlane, require_distinct
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import Array

SQUARE = np.array([[1, 1, 0.1], [1, -1, 0.1], [-1, -1, 0.1], [-1, 1, 0.1]])


@given(st.integers(0, 10**6), st.integers(4, 20))
@settings(max_examples=50, deadline=None)
def test_beacons_of_any_plane_are_rebuilt_from_their_plane(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.uniform(-2, 2, (count, 2)), np.zeros(count)])
    beacons = Rotation.random(rng=rng).apply(flat) + rng.normal(0, 5, 3)
    plane = BeaconPlane.of(beacons)
    np.testing.assert_allclose(plane.axes @ plane.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(plane.axes) == pytest.approx(1.0)
    assert np.abs((beacons - plane.center_w) @ plane.axes[2]).max() < 1e-9
    assert len(set(plane.four)) == 4


def test_the_projective_basis_maps_the_first_three_to_shares_of_the_fourth() -> None:
    plane = BeaconPlane.of(SQUARE)
    a = (SQUARE[list(plane.four)] - plane.center_w) @ plane.axes[:2].T / plane.extent
    a = np.column_stack([a, np.ones(4)])
    shares = 1.0 / plane.homography[3, :3]
    np.testing.assert_allclose(shares @ a[:3], a[3], atol=1e-12)
    np.testing.assert_allclose(plane.homography[:3, :3] @ a[:3].T, np.diag(1 / shares), atol=1e-12)


def test_of_many_beacons_four_wide_apart_are_taken() -> None:
    cluster = 0.05 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]) + [0, 0, 0.1]
    plane = BeaconPlane.of(np.concatenate([cluster, SQUARE]))
    assert sorted(plane.four) == [4, 5, 6, 7]


def test_three_of_four_on_a_line_span_no_homography() -> None:
    beacons = np.array([[-1, 0, 0], [0, 0, 0], [1, 0, 0], [0.0, 1, 0]])
    assert not BeaconPlane.of(beacons).spanned
    assert BeaconPlane.of(np.concatenate([beacons, [[0.5, -1.0, 0]]])).spanned


@pytest.mark.parametrize(
    ("beacons", "ids", "kind", "says"),
    [
        (SQUARE[:3], None, DegenerateGeometryError, "at least 4"),
        (np.outer(np.arange(5), [1, 2, 3]), None, DegenerateGeometryError, "one line"),
        (np.ones((4, 3)), None, DegenerateGeometryError, "one line or at one point"),
        (SQUARE + np.diag([0, 0, 0.2, 0])[:4, :3], None, DegenerateGeometryError, "leave their"),
        (SQUARE, [1, 2, 2, 4], DegenerateGeometryError, "beacon 2 appears more than once"),
        (SQUARE, [1, 2, 3], MeasurementError, "3 ids for 4 beacons"),
        (SQUARE * np.nan, None, MeasurementError, "not finite"),
        (SQUARE[:, :2], None, MeasurementError, r"\(N, 3\) is needed"),
        ([["here"]], None, MeasurementError, "array of numbers"),
    ],
)
def test_each_fault_has_its_sentence(
    beacons: Array, ids: list[int] | None, kind: type[MeasurementError], says: str
) -> None:
    with pytest.raises(kind, match=says) as caught:
        BeaconPlane.of(beacons, ids)
    assert type(caught.value) is kind
    assert "\n" not in str(caught.value)


def test_distinct_ids_pass() -> None:
    require_distinct([3, 1, 2])


def test_other_fours_leave_out_one_each_and_span() -> None:
    cluster = np.array([[0.5, 0.1, 0.1], [-0.4, 0.3, 0.1]])
    plane = BeaconPlane.of(np.concatenate([SQUARE, cluster]))
    others = plane.others()
    assert len(others) == 4
    for other, left_out in zip(others, plane.four, strict=True):
        assert left_out not in other.four
        assert len(set(other.four)) == 4
    assert BeaconPlane.of(SQUARE).others() == []
