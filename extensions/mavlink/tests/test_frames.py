"""Our axes become MAVLink's (north, east, down; forward, right, down), and come back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from extensions.mavlink.frames import (
    Quaternion,
    parse_origin,
    swap_attitude,
    swap_body,
    swap_world,
    swap_yaw,
)
from quadrotor.errors import UsageError
from quadrotor.plain_rotations import roll_pitch_yaw, rotate

RNG = np.random.default_rng(20261126)
ATTITUDES = [tuple(q / np.linalg.norm(q)) for q in RNG.normal(size=(50, 4))]


def test_x_is_east_y_is_north_and_up_is_not_down() -> None:
    assert swap_world((1.0, 2.0, 3.0)) == (2.0, 1.0, -3.0)
    assert swap_body((1.0, 2.0, 3.0)) == (1.0, -2.0, -3.0)
    assert swap_yaw(0.0) == pytest.approx(math.pi / 2.0)  # along x is to the east
    assert swap_yaw(math.pi / 2.0) == pytest.approx(0.0)


@pytest.mark.parametrize("q_wb", ATTITUDES)
def test_a_body_vector_is_the_same_arrow_in_both_descriptions(q_wb: Quaternion) -> None:
    q_ned = swap_attitude(q_wb)
    x, y, z = RNG.normal(size=3).tolist()
    v_b = (x, y, z)
    in_ned = rotate(q_ned, swap_body(v_b))
    assert in_ned == pytest.approx(swap_world(rotate(q_wb, v_b)))
    back = np.array(swap_attitude(q_ned))
    assert abs(float(back @ np.array(q_wb))) == pytest.approx(1.0)


def test_a_level_attitude_has_the_swapped_yaw_and_no_tilt() -> None:
    yaw = 0.3
    angles = roll_pitch_yaw(*swap_attitude((math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))))
    assert angles == pytest.approx((0.0, 0.0, swap_yaw(yaw)))


def test_nose_up_is_nose_up_and_the_right_side_down_is_roll_to_the_right() -> None:
    pitch, roll = -0.2, 0.1  # about y to the left and x forward: nose up, right side down
    east = swap_attitude((math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0))
    assert roll_pitch_yaw(*east)[1] == pytest.approx(0.2)
    rolled = swap_attitude((math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0))
    assert roll_pitch_yaw(*rolled)[0] == pytest.approx(0.1)


def test_a_place_on_earth_and_a_point_in_the_world_are_the_same() -> None:
    origin = parse_origin("47.4,8.5,400")
    point = (3.0, -2.0, 1.5)
    place = origin.global_of(point)
    assert origin.world_of(place) == pytest.approx(point, abs=1e-8)
    assert place.altitude == 401.5
    north = origin.global_of((0.0, 6371000.0 * math.radians(0.001), 0.0))
    assert (north.latitude, north.longitude) == pytest.approx((47.401, 8.5))


@pytest.mark.parametrize(
    "words", ["", "1", "here,there", "91,0,0", "0,181,0", "nan,0,0", "1,2,inf"]
)
def test_what_is_no_place_is_refused_in_one_line(words: str) -> None:
    with pytest.raises(UsageError, match=r"--origin .* is not a place; give LATITUDE,LONGITUDE"):
        parse_origin(words)
