"""Bearings are drawn as cones around them, and only while a client asks for them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.foxglove.cones import COLORS, LENGTH, cones, triangles
from vehicle_link.messages import decode
from vehicle_link.topics.measurements import encode_bearings

UNIT = 1.0 / math.sqrt(3.0)
SEEN = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (UNIT, -UNIT, UNIT))


@pytest.mark.parametrize(("topic", "number"), [("bearings", 0), ("neighbour_bearings", 1)])
def test_each_bearing_is_the_axis_of_a_cone_of_three_deviations(topic: str, number: int) -> None:
    payload = encode_bearings(5_000_000_007, (7, 8, 9), np.array(SEEN), 0.02, "quad2")
    drawn = cones(topic, payload, "quad2")
    assert drawn is not None
    (marker,) = decode(drawn, "visualization_msgs/MarkerArray").markers
    assert (marker.header.frame_id, marker.id, marker.action) == ("quad2/body", number, 0)
    assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (5, 7)
    color = (marker.color.r, marker.color.g, marker.color.b, marker.color.a)
    assert color == pytest.approx(COLORS[topic], abs=1e-6)
    corners = np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(3, -1, 3, 3)
    for bearing, cone in zip(SEEN, corners, strict=True):
        assert np.all(cone[:, 0] == 0.0)  # the tip
        rim = cone[:, 1:].reshape(-1, 3)
        assert np.linalg.norm(rim, axis=1) == pytest.approx(LENGTH)
        assert np.arccos(rim @ bearing / LENGTH) == pytest.approx(0.06)
        assert rim.mean(axis=0) == pytest.approx(LENGTH * math.cos(0.06) * np.array(bearing))


def test_nothing_is_drawn_without_bearings_and_a_cone_never_turns_over() -> None:
    nothing = encode_bearings(1, (), np.zeros((0, 3)), 0.02, "quad1")
    assert cones("bearings", nothing, "quad1") is None
    assert cones("bearings", nothing[:9], "quad1") is None
    rim = triangles(np.array(SEEN[:1]), 100.0)[0, :, 1]
    assert np.arccos(rim[:, 0] / LENGTH) == pytest.approx(math.radians(60.0))
