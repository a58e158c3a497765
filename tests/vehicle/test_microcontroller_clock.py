"""The vehicle's clock: unwrapped milliseconds from the least delayed of the first samples."""

from __future__ import annotations

import random

from vehicle.microcontroller_clock import MS, SETTLING_SAMPLES, MicrocontrollerClock


def test_time_goes_on_through_the_wrap() -> None:
    clock = MicrocontrollerClock(0)
    elapsed = [clock.elapsed_ns(ms % 60_000) for ms in range(59_000, 190_000, 250)]
    assert elapsed == [250 * MS * k for k in range(len(elapsed))]


def test_a_sample_up_to_a_second_late_has_an_earlier_time() -> None:
    clock = MicrocontrollerClock(0)
    assert clock.elapsed_ns(10) == 0
    assert clock.elapsed_ns(12) == 2 * MS
    assert clock.elapsed_ns(59_990) == -20 * MS
    assert clock.elapsed_ns(14) == 4 * MS


def test_the_epoch_is_the_least_arrival_less_the_elapsed_time() -> None:
    generator = random.Random(7)
    now = [0]
    clock = MicrocontrollerClock(host_ns=lambda: now[0])
    delays = [generator.randrange(100_000, 20 * MS) for _ in range(SETTLING_SAMPLES)]
    for k, delay in enumerate(delays):
        assert not clock.settled
        now[0] = 1_700_000_000_000_000_000 + 2 * MS * k + delay
        elapsed = clock.elapsed_ns(2 * k)
        assert elapsed is not None
        clock.settle(elapsed, 1)
    assert clock.settled
    assert clock.stamp_ns(0) == 1_700_000_000_000_000_000 + min(delays)


def test_samples_that_waited_unread_do_not_shift_the_epoch() -> None:
    clock = MicrocontrollerClock(host_ns=lambda: 5_000 * MS)
    newest = 0
    for k in range(120):  # 240 ms of samples, read in one go
        newest = clock.elapsed_ns(2 * k) or 0
    clock.settle(newest, 120)
    assert clock.stamp_ns(newest) == 5_000 * MS


def test_a_given_epoch_needs_no_host_clock() -> None:
    def host_ns() -> int:
        raise AssertionError("the host's clock was read")

    clock = MicrocontrollerClock(42, host_ns)
    assert clock.settled
    assert clock.stamp_ns(8) == 50
