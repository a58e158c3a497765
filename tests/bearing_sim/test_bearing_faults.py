"""Each fault of the emulated bearings, by the values of its frames."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from bearing_sim import BearingEmulator, BearingMeasurement, BearingParameters
from quadrotor.parameters import ParameterStore
from quadrotor.plain_rotations import Array

MS = 1_000_000
HERE = np.array([0.2, -0.1, 1.2])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
EXACT = 0.05
"""Least noise, in deg, that the emulator has."""


def frames(faults: str, seconds: float = 1.0, **values: float) -> list[BearingMeasurement]:
    """Return the frames of a vehicle at rest."""
    parameters = BearingParameters(rate=50.0, sigma=EXACT)
    ParameterStore(parameters).preset({**values, "faults": faults})
    emulator = BearingEmulator(parameters)
    for k in range(round(100 * seconds) + 1):
        emulator.observe(10 * MS * k, HERE, LEVEL)
    return emulator.due(10**15)


def bearing_of(frame: BearingMeasurement, id: int) -> Array:
    found: Array = frame.bearings_b[frame.beacon_ids.tolist().index(id)]
    return found


def angle(one: Array, other: Array) -> float:
    """Return the angle between two unit vectors in deg."""
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(one, other))), float(one @ other)))


def pairs(faults: str) -> Iterator[tuple[float, BearingMeasurement, BearingMeasurement]]:
    """Yield time (s), frame without and frame with these faults, of the same noise."""
    for was, now in zip(frames(""), frames(faults), strict=True):
        assert was.stamp_ns == now.stamp_ns
        yield 1e-9 * was.stamp_ns, was, now


def test_without_a_fault_that_is_on_nothing_changes_to_the_bit() -> None:
    noise = {"sigma": 1.5, "occlusion": 0.2, "swap": 0.3, "drop_out": 0.1}
    for was, now in zip(
        frames("", **noise), frames("bearings.lens from=1000", **noise), strict=True
    ):
        assert was.stamp_ns == now.stamp_ns
        np.testing.assert_array_equal(was.beacon_ids, now.beacon_ids)
        np.testing.assert_array_equal(was.bearings_b, now.bearings_b)


def test_a_beacon_moves_and_its_stated_place_stays() -> None:
    for t, was, now in pairs("bearings.moving_beacon id=2 x=1 z=0.5 from=0.3"):
        assert now.beacons is not None
        k = now.beacons.ids.tolist().index(2)
        place = now.beacons.positions_w[k] + max(0.0, t - 0.3) * np.array((1.0, 0, 0.5))
        toward = (place - HERE) / np.linalg.norm(place - HERE)
        assert angle(bearing_of(now, 2), toward) < 6 * EXACT
        np.testing.assert_array_equal(bearing_of(now, 1), bearing_of(was, 1))


def test_two_identities_are_exchanged_while_it_lasts() -> None:
    for t, was, now in pairs("bearings.swapped_identities first=1 second=3 from=0.2 to=0.6"):
        other = {1: 3, 3: 1} if 0.2 <= t < 0.6 else {}
        assert now.beacon_ids.tolist() == [other.get(id, id) for id in was.beacon_ids.tolist()]
        np.testing.assert_array_equal(now.bearings_b, was.bearings_b)


def test_a_lens_moves_bearings_away_from_its_axis_by_the_cube_of_the_angle() -> None:
    axis = np.array((0.0, 0.0, -1.0))
    for _, was, now in pairs("bearings.lens k=0.1"):
        for id in was.beacon_ids.tolist():
            theta = math.radians(angle(bearing_of(was, id), axis))
            found = math.radians(angle(bearing_of(now, id), axis))
            assert found == pytest.approx(theta + 0.1 * theta**3, abs=math.radians(12 * EXACT))


def test_correlated_noise_has_its_deviation_and_correlation_and_its_seed() -> None:
    text = "bearings.correlated_noise sigma=2 time=0.5"
    wander = np.array(
        [
            [angle_about_z(bearing_of(one, id), bearing_of(was, id)) for id in (1, 2, 3)]
            for was, one in zip(frames("", 120.0), frames(text, 120.0), strict=True)
        ]
    )
    for series in wander.T:
        series = series - series.mean()  # noqa: PLW2901 - of 240 correlation times
        near = float((series[25:] * series[:-25]).mean() / series.var())
        assert near == pytest.approx(math.exp(-1.0), abs=0.15)
    assert abs(np.corrcoef(wander.T)[0, 1]) < 0.25
    again = frames(text, 2.0)
    for one, other in zip(again, frames(text, 2.0), strict=True):
        np.testing.assert_array_equal(one.bearings_b, other.bearings_b)
    seeded = frames(text, 2.0, seed=9)
    assert not np.array_equal(again[50].bearings_b, seeded[50].bearings_b)


def angle_about_z(one: Array, other: Array) -> float:
    """Return the difference of azimuth, in deg."""
    return math.degrees(math.atan2(one[1], one[0]) - math.atan2(other[1], other[0]))


def test_a_parameter_of_the_bearings_follows_a_schedule() -> None:
    for t, was, now in pairs("bearings.bias_z value=10 from=0.2 ramp=0.4"):
        expected = 10.0 * min(1.0, max(0.0, (t - 0.2) / 0.4))
        turned = angle_about_z(bearing_of(now, 1), bearing_of(was, 1))
        assert turned == pytest.approx(expected, abs=1e-6 + 20 * EXACT * (expected > 0))
