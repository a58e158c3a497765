"""A preview says of a trajectory what its start would."""

from __future__ import annotations

import math

import numpy as np
import pytest

from control.behaviors.preview import POINTS, preview
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameter_description import ParameterValue

HERE = (1.0, -0.5, 1.2, 0.3)


def test_the_path_begins_and_ends_here_and_has_the_trajectorys_pace() -> None:
    found = preview(HERE, {"trajectory": "circle", "laps": 2, "period": 8.0, "radius": 0.5}, {})
    points = np.asarray(found.points)
    assert points.shape == (POINTS, 3)
    np.testing.assert_allclose(points[[0, -1]], [HERE[:3]] * 2, atol=1e-9)
    assert found.duration == pytest.approx(2 * 8.0 + 3.0)
    assert found.speed == pytest.approx(2.0 * math.pi * 0.5 / 8.0, rel=1e-3)
    assert found.refusal == ""


def test_what_the_vehicle_would_refuse_has_a_path_and_the_reason() -> None:
    walls = {"behavior.volume_x_max": 1.2, "other.name": 3}
    found = preview(HERE, {"trajectory": "figure_eight"}, walls)
    assert "is outside the flight volume" in found.refusal
    assert "allowed -3 to 1.2 m" in found.refusal
    assert len(found.points) == POINTS


def test_the_vehicles_own_model_limits_what_can_be_flown() -> None:
    quick: dict[str, ParameterValue] = {"trajectory": "circle", "radius": 1.0, "period": 4.0}
    light, heavy = (
        preview((0.0, -1.0, 1.2, 0.0), quick, {"model.mass": mass}).refusal for mass in (1.3, 5.0)
    )
    assert light == ""
    assert "thrust" in heavy


def test_arguments_out_of_bounds_are_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="radius = 99"):
        preview(HERE, {"trajectory": "circle", "radius": 99.0}, {})
