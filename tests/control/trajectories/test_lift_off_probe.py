"""The circle at lift-off is smooth, ends where it began, and tilts by as much as it is told."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from control.behaviors.behavior import Context, TickInputs
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.take_off import TakeOff
from control.trajectories.lift_off_probe import DURATION, add_probe
from quadrotor.constants import GRAVITY
from quadrotor.records import Array, new_reference

TILT = math.radians(2.5)
PARTS = ("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w")


def sampled(times: Array) -> dict[str, Array]:
    """Return each part of the reference at these times (s)."""
    found = {part: np.empty((len(times), 3)) for part in PARTS}
    for k, t in enumerate(times.tolist()):
        reference = new_reference()
        reference["position_w"] = 0.0
        add_probe(t, TILT, reference)
        for part in PARTS:
            found[part][k] = reference[part][0]
    return found


def test_each_part_is_the_derivative_of_the_one_before() -> None:
    times = np.linspace(0.001, DURATION - 0.001, 4001)
    found = sampled(times)
    for one, other in pairwise(PARTS):
        slope = np.gradient(found[one][:, :2], times, axis=0)[2:-2]
        largest = np.abs(found[other]).max()
        assert np.abs(slope - found[other][2:-2, :2]).max() < 1e-3 * largest


def test_it_begins_and_ends_at_rest_and_tilts_as_told_in_every_direction() -> None:
    found = sampled(np.linspace(-0.1, DURATION + 0.1, 6001))
    tilts = np.hypot(*found["acceleration_w"][:, :2].T) / GRAVITY
    assert abs(math.atan(tilts.max()) - TILT) < 1e-4
    assert np.abs(found["position_w"]).max() < 0.002
    assert not found["position_w"][:, 2].any()
    for part in PARTS[:4]:
        steps = np.abs(np.diff(found[part], axis=0)).max()
        assert steps < 0.02 * np.abs(found[part]).max()
    strong = found["acceleration_w"][tilts > 0.5 * tilts.max()]
    turned = np.ptp(np.unwrap(np.arctan2(strong[:, 1], strong[:, 0])))
    assert turned > 0.5 * math.pi  # along both axes, not along one line


def test_a_take_off_flies_it_above_the_ground_alone_or_not_at_all() -> None:
    for tilt in (0.0, 2.5):
        parameters = BehaviorParameters(take_off_probe=tilt)
        behavior = TakeOff.start(Context(new_reference(), parameters, 12.8), {})
        tick, reference, aside = TickInputs(dt=0.002), new_reference(), []
        while not behavior.step(tick, reference):
            aside.append((reference["position_w"][0, 2], abs(reference["position_w"][0, :2]).max()))
        heights, far = np.array(aside).T
        assert bool(far.max() > 0.0005) is (tilt > 0.0)
        assert far[heights < 0.005].max() == 0.0
        assert far[heights > 0.3].max() == 0.0
