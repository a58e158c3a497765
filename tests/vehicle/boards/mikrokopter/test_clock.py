"""The vehicle's clock: unwrapped milliseconds from the least delayed of the first samples."""

from __future__ import annotations

import random

from vehicle.boards.mikrokopter.clock import (
    FRAME_NS,
    LATEST_NS,
    MS,
    SETTLING_NS,
    MicrocontrollerClock,
)


def test_time_goes_on_through_the_wrap() -> None:
    clock = MicrocontrollerClock(0)
    elapsed = [clock.elapsed_ns(ms % 60_000) for ms in range(59_000, 190_000, 50)]
    assert elapsed == [50 * MS * k for k in range(len(elapsed))]


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
    delays = [generator.randrange(100_000, 20 * MS) for _ in range(SETTLING_NS // (2 * MS) + 1)]
    for k, delay in enumerate(delays):
        assert not clock.settled
        now[0] = 1_700_000_000_000_000_000 + 2 * MS * k + delay
        elapsed = clock.elapsed_ns(2 * k)
        assert elapsed is not None
        clock.settle(elapsed, 1)
    assert clock.settled
    assert clock.stamp_ns(0) == 1_700_000_000_000_000_000 + min(delays) - FRAME_NS


def test_samples_that_waited_unread_do_not_shift_the_epoch() -> None:
    clock = MicrocontrollerClock(host_ns=lambda: 5_000 * MS)
    newest = 0
    for k in range(240):  # 480 ms of samples, read in one go
        newest = clock.elapsed_ns(2 * k) or 0
    clock.settle(newest, 240)
    assert clock.stamp_ns(newest) == 5_000 * MS - FRAME_NS


def test_a_clock_set_by_late_samples_is_set_back_by_the_first_in_time() -> None:
    late, now = 380 * MS, [0]
    clock = MicrocontrollerClock(host_ns=lambda: now[0], steady_ns=lambda: 0)
    for k in range(SETTLING_NS // (2 * MS) + 1):
        now[0] = 2 * MS * k + FRAME_NS + late
        clock.settle(2 * MS * k, 1)
    assert clock.settled
    assert clock.correct(2 * MS * k) == 0.0
    ahead = clock.correct(2 * MS * k + late)  # arrives in time again
    assert ahead == 0.380
    assert clock.stamp_ns(0) == 0
    assert clock.correct(2 * MS * k + late + 4 * MS) == 0.0, "4 ms may be the clocks' drift"


class Settled:
    """Clock settled at 0, on a host whose two clocks are moved by hand, ns."""

    def __init__(self, late_ns: int = 0) -> None:
        self.host_ns = self.steady_ns = 0
        self.clock = MicrocontrollerClock(
            host_ns=lambda: self.host_ns, steady_ns=lambda: self.steady_ns
        )
        self.elapsed_ns = -2 * MS
        while not self.clock.settled:
            self.pass_ns(2 * MS)
            self.host_ns = self.elapsed_ns + FRAME_NS + late_ns
            self.clock.settle(self.elapsed_ns, 1)

    def pass_ns(self, passed_ns: int) -> None:
        self.elapsed_ns += passed_ns
        self.host_ns += passed_ns
        self.steady_ns += passed_ns


def test_late_first_samples_are_put_right() -> None:
    host = Settled(late_ns=380 * MS)
    assert host.clock.correct(host.elapsed_ns + 380 * MS) == 0.380
    assert host.clock.stamp_ns(0) == 0


def test_a_clock_ahead_by_more_than_late_samples_explain_is_left() -> None:
    host = Settled()
    assert host.clock.correct(host.elapsed_ns + LATEST_NS + 1) == 0.0
    assert host.clock.stamp_ns(0) == 0
    assert host.clock.correct(host.elapsed_ns + LATEST_NS) == LATEST_NS * 1e-9


def test_a_given_epoch_needs_no_host_clock() -> None:
    def host_ns() -> int:
        raise AssertionError("the host's clock was read")

    clock = MicrocontrollerClock(42, host_ns)
    assert clock.settled
    assert clock.correct(8) == 0.0
    assert clock.stamp_ns(8) == 50


class Host:
    """Steady clock that is moved by hand, ms."""

    def __init__(self) -> None:
        self.ms = 0
        self.clock = MicrocontrollerClock(steady_ns=lambda: self.ms * MS)

    def after(self, passed_ms: int, ms: int) -> float | None:
        """Pass a sample that arrives so much later; return its elapsed time in ms."""
        self.ms += passed_ms
        elapsed = self.clock.elapsed_ns(ms)
        return None if elapsed is None else elapsed / MS


def test_samples_more_than_a_second_late_do_not_move_the_clock_on() -> None:
    host = Host()
    assert host.after(0, 30_000) == 0.0
    assert host.after(2, 30_002) == 2.0
    for late in (28_950, 28_952, 28_954):  # 1.05 s late, or 58.95 s ahead
        assert host.after(0, late) is None
    assert host.after(2, 30_004) == 4.0


def test_a_gap_that_the_host_has_seen_is_a_gap() -> None:
    host = Host()
    assert host.after(0, 10_000) == 0.0
    assert host.after(40_000, 50_000) is None  # a second one must confirm it
    assert host.after(2, 50_002) == 40_002.0


def test_a_microcontroller_that_began_anew_goes_on_from_where_the_host_is() -> None:
    host = Host()
    assert host.after(0, 45_000) == 0.0
    told = [host.after(2, 2 * k) for k in range(600)]
    assert told[:500] == [None] * 500
    assert told[500] == 1002.0
    assert told[501:] == [1002.0 + 2.0 * k for k in range(1, 100)]


def test_a_time_that_only_one_sample_tells_is_not_believed() -> None:
    host = Host()
    assert host.after(0, 30_000) == 0.0
    assert host.after(2, 30_302) is None  # 300 ms ahead: correct ones would be late until then
    assert host.after(2, 30_004) == 4.0
    assert host.after(2, 30_006) == 6.0


def test_samples_read_long_after_they_came_are_in_their_order_and_a_hole_in_them_is_one() -> None:
    host = Host()
    assert host.after(0, 0) == 0.0
    assert [host.after(5_000 if k == 1 else 0, 2 * k) for k in range(1, 100)] == [
        2.0 * k for k in range(1, 100)
    ]
    assert host.after(0, 3_198) is None  # what the port could not buffer in the meantime
    assert host.after(0, 3_200) == 3_200.0
    assert host.after(2, 3_202) == 3_202.0


def test_a_fast_microcontroller_is_no_late_sample() -> None:
    host = Host()
    assert host.after(0, 0) == 0.0
    for k in range(1, 2_000):  # 2.5 % fast: two seconds ahead after 80
        assert host.after(40, 41 * k % 60_000) == 41.0 * k
    assert host.after(700, (41 * 1_999 + 715) % 60_000) is None  # a gap, to be confirmed
    assert host.after(2, (41 * 1_999 + 717) % 60_000) == 41 * 1_999 + 717
