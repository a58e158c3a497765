"""References that follow set-points are such that the vehicle's own check accepts each of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from control.behaviors.behavior import Context, ExternalReference, TickInputs
from control.behaviors.external import External
from control.behaviors.parameters import BehaviorParameters
from extensions.mavlink.dialect import mavlink
from extensions.mavlink.frames import parse_origin
from extensions.mavlink.offboard import PERIOD, Follower, SetPoint, set_point_of
from quadrotor.errors import RefusedError
from quadrotor.records import new_reference
from quadrotor.vehicle_model import GRAVITY

ORIGIN = parse_origin("47.4,8.5,0")
LIMITS = BehaviorParameters()
PARAMETERS = {f"behavior.{name}": value for name, value in LIMITS.model_dump().items()}
STEP_NS = round(PERIOD * 1e9)


def start() -> Any:
    reference = new_reference()
    reference["position_w"] = (0.0, 0.0, 1.0)
    return reference


def fly(set_points: list[SetPoint], seconds: float) -> tuple[Any, str]:
    """Return the last reference, and why the vehicle's behavior ended, "" if it did not."""
    follower, outside = Follower(start(), PARAMETERS), ExternalReference()
    outside.reference[:], outside.stamp_ns = follower.reference, 0
    context = Context(start(), LIMITS, 1.308 * GRAVITY, outside=outside)
    behavior, flown = External.start(context, {}), start()
    for k in range(1, int(seconds / PERIOD)):
        follower.step(set_points[(k - 1) * len(set_points) * STEP_NS // int(seconds * 1e9)], PERIOD)
        outside.reference[:], outside.stamp_ns = follower.reference, k * STEP_NS
        if behavior.step(TickInputs(k * STEP_NS, PERIOD), flown):
            return flown, behavior.aborted
    return flown, ""


def position(x: float, y: float, z: float, yaw: float | None = None) -> SetPoint:
    return SetPoint((x, y, z), None, False, yaw, 0.0, 0)


def test_a_jump_of_set_points_across_the_volume_is_flown_and_arrives() -> None:
    flown, aborted = fly([position(2.5, -2.5, 2.5, 3.0)], 12.0)
    assert aborted == ""
    assert np.linalg.norm(flown["position_w"][0] - (2.5, -2.5, 2.5)) < 0.02
    assert math.remainder(float(flown["yaw"][0]) - 3.0, 2.0 * math.pi) == pytest.approx(0, abs=0.02)


def test_set_points_that_jump_back_and_forth_are_never_refused() -> None:
    rng = np.random.default_rng(7)
    points = []
    for x, y, z, yaw in rng.uniform(-1.0, 1.0, (40, 4)).tolist():
        points.append(position(5.0 * x, 5.0 * y, 5.0 * z, 3.0 * yaw))
    assert fly(points, 40.0)[1] == ""


def test_full_speed_towards_a_wall_ends_before_it() -> None:
    fast = SetPoint(None, (50.0, 0.0, 0.0), False, None, 0.0, 0)
    flown, aborted = fly([fast], 15.0)
    assert aborted == ""
    assert 2.8 < flown["position_w"][0, 0] < LIMITS.volume_x_max


def test_a_body_velocity_is_along_the_nose() -> None:
    ahead = SetPoint(None, (0.5, 0.0, 0.0), True, None, 0.0, 0)
    turning = [position(0.0, 0.0, 1.0, math.pi / 2.0)] * 2 + [ahead] * 2
    flown, aborted = fly(turning, 8.0)
    assert aborted == ""
    assert flown["velocity_w"][0] == pytest.approx((0.0, 0.5, 0.0), abs=0.02)


def message(mask: int, frame: int = mavlink.MAV_FRAME_LOCAL_NED, **numbers: float) -> Any:
    names = ("x", "y", "z", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate")
    zeros = dict.fromkeys(names, 0.0)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, frame, mask, **{**zeros, **numbers}
    )


def test_set_points_are_turned_into_our_axes() -> None:
    all_of_it = message(0b100111000000, x=1.0, y=2.0, z=-3.0, vx=0.1, vy=0.2, vz=-0.3, yaw=0.0)
    wanted = set_point_of(all_of_it, ORIGIN, 5)
    assert wanted.position_w == (2.0, 1.0, 3.0)
    assert wanted.velocity == pytest.approx((0.2, 0.1, 0.3))
    assert wanted.yaw == pytest.approx(math.pi / 2.0)
    in_body = message(
        0b010111000111, mavlink.MAV_FRAME_BODY_NED, vx=0.1, vy=0.2, vz=0.3, yaw_rate=0.4
    )
    wanted = set_point_of(in_body, ORIGIN, 5)
    assert (wanted.velocity, wanted.yaw, wanted.yaw_rate) == ((0.1, -0.2, -0.3), None, -0.4)


@pytest.mark.parametrize(
    ("sent", "line"),
    [
        (message(0b111111111111), "only set-points of position, velocity or both"),
        (message(0b110111111001), "needs all of x, y, z"),
        (message(0b110111001111), "needs all of vx, vy, vz"),
        (message(0b110111111000, frame=20), "in frame 20 are not flown"),
        (message(0b110111111000, x=math.nan), "a number that is not finite"),
    ],
)
def test_set_points_that_cannot_be_flown_are_refused(sent: Any, line: str) -> None:
    with pytest.raises(RefusedError, match=line):
        set_point_of(sent, ORIGIN, 0)
