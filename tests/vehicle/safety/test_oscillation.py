"""Swings that grow or go on are an oscillation; what decays, drifts or is rough air is none."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from quadrotor.records import new_reference, new_state
from vehicle.estimators.estimator_runner import BEARINGS, POSES
from vehicle.modes import Flag
from vehicle.safety.oscillation import CHANNELS, OscillationWatch

DT = 0.002
Signal = Callable[[float], float]


class Flown:
    """Flight of a watch whose state is given by functions of time."""

    def __init__(self) -> None:
        self.state, self.reference = new_state(), new_reference()
        self.said: list[str] = []
        self.watch = OscillationWatch(
            self.state, self.reference, lambda text, _: self.said.append(text)
        )
        self.time, self.source = 0.0, POSES

    def fly(self, seconds: float, axis: int, signal: Signal) -> float:
        """Fly until the watch finds something; return when, inf if it does not."""
        end = self.time + seconds
        while self.time < end:
            self.time += DT
            name = "position_w" if axis < 3 else "angular_velocity_b"
            self.state[name][0, axis % 3] = signal(self.time)
            self.watch.step(DT, self.source)
            if self.watch.flags:
                return self.time
        return math.inf

    def settled(self) -> Flown:
        """Hover well for as long as a flight needs to have a past."""
        assert self.fly(20.0, 0, lambda t: 0.002 * math.sin(7.0 * t)) == math.inf
        return self


@pytest.mark.parametrize(
    ("axis", "frequency", "rate"),
    [(0, 0.4, 0.3), (1, 0.7, 1.0), (2, 1.5, 1.0), (3, 4.0, 2.0), (4, 8.0, 5.0), (5, 1.2, 1.0)],
)
def test_growth_is_found_within_a_second_and_a_half_of_its_limit(
    axis: int, frequency: float, rate: float
) -> None:
    flown, limit = Flown().settled(), (0.03, 0.03, 0.03, 1.0, 1.0, 0.5)[axis]
    began = flown.time
    size = 0.2 * limit

    def grows(t: float) -> float:
        return size * math.exp(rate * (t - began)) * math.sin(2 * math.pi * frequency * (t - began))

    found = flown.fly(20.0, axis, grows)
    reached = began + math.log(5.0) / rate  # its size is the limit
    assert found - reached <= 1.5
    assert flown.watch.flags == Flag.OSCILLATING
    assert flown.watch.frequency == pytest.approx(frequency, rel=0.15)
    assert f"oscillating in {CHANNELS[axis]} at {flown.watch.frequency:.1f} Hz" in flown.said[0]


def test_an_oscillation_that_goes_on_is_found_and_over_when_it_ends() -> None:
    flown = Flown().settled()
    assert flown.fly(10.0, 0, lambda t: 0.06 * math.sin(4.0 * t)) < math.inf
    began = flown.time
    while flown.watch.flags and flown.time < began + 20.0:
        flown.fly(DT, 0, lambda _: 0.0)
    assert flown.time - began == pytest.approx(3.0, abs=1.7)
    assert flown.said[1].startswith("no longer oscillating in x")


@pytest.mark.parametrize(
    "signal",
    [
        lambda t: 0.2 * math.exp(-0.8 * (t - 20.0)) * math.sin(4.0 * (t - 20.0)),
        lambda t: 0.15 if t % 8.0 < 4.0 else 0.0,
        lambda t: 0.2 * math.sin(0.5 * t),
        lambda t: 0.02 * math.sin(4.0 * t),
    ],
    ids=["decays", "steps", "slow", "small"],
)
def test_what_decays_steps_or_is_slow_or_small_is_none(signal: Signal) -> None:
    assert Flown().settled().fly(30.0, 0, signal) == math.inf


def swings(began: float, sizes: Sequence[float], lasts: Sequence[float]) -> Signal:
    """Return half sines of alternating sign, of these sizes and durations (s), and then nothing."""
    edges = began + np.concatenate([[0.0], np.cumsum(lasts)])

    def signal(t: float) -> float:
        k = int(np.searchsorted(edges, t, "right")) - 1
        if not 0 <= k < len(sizes):
            return 0.0
        return (1 - 2 * (k % 2)) * sizes[k] * math.sin(math.pi * float(t - edges[k]) / lasts[k])

    return signal


GROWING = 0.012, 0.018, 0.027, 0.04, 0.018, 0.012


@pytest.mark.parametrize(
    ("sizes", "moves", "is_told"),
    [
        (GROWING, False, True),
        ((0.036, 0.02, 0.016, 0.028, 0.045, 0.02), False, False),  # only the last ones grow
        (GROWING, True, False),
        ((0.03, 0.045, 0.07, 0.1, 0.04, 0.02), True, True),
    ],
    ids=["grows", "a gust", "a motion begins", "grows in a motion"],
)
def test_positions_grow_over_four_swings_and_further_while_a_motion_is_new(
    sizes: Sequence[float], moves: bool, is_told: bool
) -> None:
    flown = Flown().settled()
    flown.reference["velocity_w"][0, 0] = 0.5 if moves else 0.0
    signal = swings(flown.time, sizes, [0.8] * len(sizes))
    assert (flown.fly(8.0, 0, signal) < math.inf) == is_told


@pytest.mark.parametrize(("second", "is_told"), [(0.8, True), (1.2, False)])
def test_regular_swings_are_told_before_they_are_large(second: float, is_told: bool) -> None:
    flown = Flown().settled()
    sizes = 0.008, 0.01, 0.013, 0.017, 0.022, 0.028, 0.005
    signal = swings(flown.time, sizes, [0.8, 0.8, second, second, 0.8, 0.8, 0.8])
    assert (flown.fly(8.0, 0, signal) < math.inf) == is_told


def test_a_yaw_that_swings_back_more_slowly_is_an_oscillation() -> None:
    flown = Flown().settled()
    lasts = [0.5, 0.9] * 8
    assert flown.fly(12.0, 5, swings(flown.time, [0.8] * len(lasts), lasts)) < math.inf
    assert flown.said[0].startswith("oscillating in yaw at 0.7 Hz")


def test_noise_as_in_rough_air_is_none_however_long_it_lasts() -> None:
    random = np.random.default_rng(7)
    fade = math.exp(-DT / 0.6)
    value = [0.0, 0.0]

    def gust(_: float) -> float:
        value[0] = fade * value[0] + 0.03 * math.sqrt(1 - fade**2) * random.standard_normal()
        value[1] += DT * (value[0] - value[1]) / 0.3
        return value[1]

    assert Flown().fly(300.0, 0, gust) == math.inf


@pytest.mark.parametrize(("source", "is_told"), [(POSES, True), (BEARINGS, False)])
def test_an_estimate_of_another_source_swings_as_its_own_noise_does(
    source: str, is_told: bool
) -> None:
    """Swings that are far above those on the tracker are usual on bearings."""
    flown = Flown().settled()
    flown.source = source
    found = flown.fly(40.0, 0, lambda t: 0.035 * math.sin(5.0 * t))
    assert (found < math.inf) == is_told


def test_far_from_the_reference_is_told_with_its_distance() -> None:
    flown = Flown().settled()
    began = flown.time
    assert flown.fly(2.0, 1, lambda _: 0.3) - began == pytest.approx(0.5, abs=0.01)
    assert flown.watch.flags == Flag.OFF_REFERENCE
    assert flown.said == ["300 mm from its reference"]
    assert flown.fly(1.0, 1, lambda _: 0.1) == math.inf
    assert flown.said[1] == "no longer 300 mm from its reference"


def test_what_is_not_finite_is_passed_over_and_the_ground_is_not_judged() -> None:
    flown = Flown().settled()
    assert flown.fly(1.0, 0, lambda _: math.nan) == math.inf
    for k in range(5000):
        flown.state["position_w"][0, 0] = 0.1 * math.sin(0.01 * k)
        flown.watch.step(DT, "")
    assert not flown.watch.flags
