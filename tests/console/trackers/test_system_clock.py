"""Conversion of a tracking system's stamps to the host's clock."""

from __future__ import annotations

import numpy as np
import pytest

from console.trackers.system_clock import AGREE, SystemClock

MS = 1_000_000
PERIOD = 10 * MS
LEAST = 3 * MS
"""Smallest delay, ns, which cannot be observed on the host."""
BEGIN = 777 * 10**9


def fly(
    clock: SystemClock, count: int, *, begin: int = 0, ahead: int = -(10**18), drift: float = 0.0
) -> list[tuple[int, int | None]]:
    """Feed frames with delays from LEAST upwards; return the true times and those found."""
    random, found = np.random.default_rng(3), []
    for k in range(begin, begin + count):
        true = BEGIN + k * PERIOD
        stamp = round(true * (1 - drift)) + ahead
        received = true + LEAST + round(random.exponential(2 * MS))
        found.append((true, clock.host_ns(stamp, received)))
    return found


def errors_ms(found: list[tuple[int, int | None]]) -> list[float]:
    return [(at - true - LEAST) / MS for true, at in found if at is not None]


@pytest.mark.parametrize("drift", [0.0, 100e-6, -100e-6])
def test_stamps_are_right_to_a_fraction_of_the_jitter_also_when_the_clock_drifts(
    drift: float,
) -> None:
    clock = SystemClock()
    found = fly(clock, 6000, drift=drift)
    settled = errors_ms(found[2000:])
    assert len(settled) == 4000
    assert max(map(abs, settled)) < 0.5
    assert clock.drift == pytest.approx(drift, abs=20e-6)
    assert clock.jumps == 0


@pytest.mark.parametrize("by", [10**9, -(10**9)])
def test_a_clock_that_is_set_is_noticed_within_five_frames_and_followed(by: int) -> None:
    clock = SystemClock()
    fly(clock, 500)
    found = fly(clock, 500, begin=500, ahead=by - 10**18)
    assert [at for _, at in found[: AGREE - 1]] == [None] * (AGREE - 1)
    assert clock.jumps == 1
    assert clock.jump_ns == pytest.approx(by, abs=20 * MS)
    assert max(map(abs, errors_ms(found[100:]))) < 2


def test_a_pause_of_the_network_is_no_clock_that_was_set() -> None:
    clock = SystemClock()
    fly(clock, 500)
    held = [BEGIN + k * PERIOD for k in range(500, 550)]
    for k, true in enumerate(held):  # all at once, at the end of the pause
        clock.host_ns(true - 10**18, held[-1] + LEAST + k * MS // 10)
    assert clock.jumps == 0
    assert max(map(abs, errors_ms(fly(clock, 100, begin=550)))) < 2
