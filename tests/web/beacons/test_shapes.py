"""Meshes, rotations and colours of the beacons' view."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from web.view.beacons.bound_image import (
    BEYOND,
    COLORS,
    OPACITY,
    Scale,
    legend,
    picture,
    round_down,
    round_up,
    shade_of,
)
from web.view.shapes import cone, cone_scales, ellipsoid, handle, matrix_of, on_plane, turns_from_z


def test_turns_bring_z_where_they_should() -> None:
    directions = np.random.default_rng(8).normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    directions = np.vstack([directions, (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)])
    for q, d in zip(turns_from_z(directions), directions, strict=True):
        np.testing.assert_allclose(matrix_of(q)[:, 2], d, atol=1e-9)


def test_a_scaled_cone_has_the_angle_of_three_sigma() -> None:
    vertices, faces = cone(28)
    assert len(faces) == 28
    scale = cone_scales(np.array([2.5]), 0.02)[0]
    rim = vertices[1:] * scale
    angles = np.arccos(rim[:, 2] / np.linalg.norm(rim, axis=1))
    np.testing.assert_allclose(angles, 0.06, rtol=1e-6)
    np.testing.assert_allclose(rim[:, 2], 2.5)
    assert np.isfinite(cone_scales(np.array([2.5]), math.radians(60.0))).all()


def test_an_ellipsoid_of_a_diagonal_covariance_lies_along_the_axes() -> None:
    found = ellipsoid(np.diag([0.04, 0.01, 0.09]))
    assert found is not None
    scale, q = found
    np.testing.assert_allclose(sorted(scale), (0.3, 0.6, 0.9))
    R = matrix_of(q)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(np.abs(R) @ scale, (0.6, 0.3, 0.9))


def test_a_handle_is_flat_and_reaches_to_four_sides() -> None:
    vertices, faces = handle(0.1, 0.2)
    assert not vertices[:, 2].any()
    assert faces.max() == len(vertices) - 1
    np.testing.assert_allclose(np.abs(vertices[:, :2]).max(axis=0), (0.2, 0.2), rtol=1e-6)


def test_a_line_of_sight_meets_the_plane() -> None:
    met = on_plane((0.0, 0.0, 2.0), (0.5, 0.25, 1.0), (7.0, 8.0, 0.0), (0.0, 0.0, 1.0))
    assert met == pytest.approx((1.0, 0.5, 0.0))


@pytest.mark.parametrize(
    "through",
    [
        (0.5, 0.25, 3.0),  # upwards, away from the plane
        (1.0, 0.0, 2.0),  # parallel to it
        (1.0, 0.0, 1.99),  # almost parallel to it
        (0.0, 0.0, 2.0),  # no direction
        (math.nan, 0.0, 0.0),
    ],
)
def test_or_it_does_not(through: tuple[float, float, float]) -> None:
    assert on_plane((0.0, 0.0, 2.0), through, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) is None


@pytest.mark.parametrize(
    ("value", "below", "above"),
    [(0.0747, 0.07, 0.1), (0.42, 0.3, 0.5), (1.0, 1.0, 1.0), (0.03, 0.03, 0.03), (8.0, 7.0, 10.0)],
)
def test_ends_of_a_scale_are_round(value: float, below: float, above: float) -> None:
    assert round_down(value) == pytest.approx(below)
    assert round_up(value) == pytest.approx(above)


def test_the_scale_spans_the_map_and_ignores_what_is_not_known() -> None:
    bound = np.full((20, 20), 0.1)
    bound[:4] = 0.42
    bound[0, 0] = math.nan
    bound[0, 1] = 50.0  # one of 400
    assert Scale.of(bound) == Scale(0.1, 0.5)
    assert Scale.of(np.full((2, 2), math.nan)) is None
    even = Scale.of(np.full((2, 2), 0.1))
    assert even is not None
    assert even.high > even.low


def test_a_picture_has_a_shade_for_every_bound_and_none_where_there_is_none() -> None:
    image = picture(np.array([[0.1, 0.3, 1.0, 3.0, math.nan, 0.01]]), Scale(0.1, 1.0))
    assert image.shape == (1, 6, 4)
    assert image[0, :, 3].tolist() == [round(255 * OPACITY)] * 4 + [0, round(255 * OPACITY)]
    assert tuple(image[0, 3, :3]) == BEYOND
    lightness = image[0, :3, :3].astype(float) @ (0.2126, 0.7152, 0.0722)
    assert (np.diff(lightness) < 0.0).all()
    assert image[0, 5].tolist() == image[0, 0].tolist(), "below the scale is its low end"


def test_its_colours_fall_in_lightness_all_along() -> None:
    lightness = [float(np.dot(shade_of(k / 50), (0.2126, 0.7152, 0.0722))) for k in range(51)]
    assert all(b < a for a, b in itertools.pairwise(lightness))
    assert shade_of(0.0) == COLORS[0]
    assert shade_of(1.0) == COLORS[-1]


def test_a_legend_says_all_a_page_needs() -> None:
    told = legend(Scale(0.07, 0.5))
    assert told["low"] == 0.07
    assert told["high"] == 0.5
    assert told["scale"] == "log"
    colors = told["colors"]
    assert isinstance(colors, list)
    assert colors[0] == "#c7e9cd"
    assert len(colors) == len(COLORS)
