"""State of the link that the station reports, on clocks that differ."""

from __future__ import annotations

import pytest

from console.link.monitor import LinkMonitor
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.time_sync import Exchange

NOW = 1_700_000_000_000_000_000
AHEAD = 5_000_000_000_000
MS = 1_000_000


class Clock:
    """Steady clock, ns."""

    now = 0

    def __call__(self) -> int:
        return self.now


def synchronised() -> LinkMonitor:
    link = LinkMonitor()
    link.exchanged(Exchange(NOW, NOW + AHEAD + MS, NOW + AHEAD + MS, NOW + 2 * MS))
    return link


def test_stamps_of_a_simulator_from_before_the_clock_was_set_become_the_vehicles() -> None:
    link = LinkMonitor()
    assert link.stamp_of_simulator(NOW) == NOW
    link.exchanged(Exchange(NOW, NOW + MS, NOW + MS, NOW + MS // 2))  # the same clock, as measured
    assert link.stamp_of_simulator(NOW) == NOW
    assert synchronised().stamp_of_simulator(NOW) == NOW + AHEAD


def test_telemetry_under_way_for_too_long_is_not_shown() -> None:
    link = synchronised()
    assert link.telemetry(1, NOW + AHEAD, NOW + 249 * MS)
    assert not link.telemetry(2, NOW + AHEAD + 10 * MS, NOW + 10 * MS + 251 * MS)
    assert link.telemetry(3, NOW + AHEAD + 300 * MS, NOW + 310 * MS)


def test_telemetry_that_waited_here_for_too_long_is_not_shown() -> None:
    link = synchronised()
    came, judged = NOW + 20 * MS, NOW + 251 * MS
    assert not link.telemetry(1, NOW + AHEAD, came, judged)
    assert link.telemetry(2, NOW + AHEAD + 10 * MS, came, judged)


def test_telemetry_that_was_overtaken_is_not_shown() -> None:
    link = synchronised()
    assert link.telemetry(2, NOW + AHEAD + 10 * MS, NOW + 12 * MS)
    assert not link.telemetry(1, NOW + AHEAD, NOW + 13 * MS)


def test_before_the_clock_is_known_everything_newest_is_shown() -> None:
    link = LinkMonitor()
    assert not link.clock_known
    assert link.telemetry(1, 7 * MS, NOW)


def test_the_age_is_that_of_the_newest_sample_in_our_own_time() -> None:
    link = synchronised()
    link.telemetry(1, NOW + AHEAD, NOW + 5 * MS)
    message = link.message(NOW + 40 * MS)
    assert message.age == pytest.approx(0.040)
    assert message.clock_offset == pytest.approx(AHEAD * 1e-9)
    assert message.round_trip == pytest.approx(0.002)


def test_heartbeats_make_the_state() -> None:
    clock = Clock()
    link = LinkMonitor(steady_ns=clock)
    assert link.state() is LinkState.LOST
    link.alive()
    for ms, state in ((199, "good"), (201, "degraded"), (999, "degraded"), (1001, "lost")):
        clock.now = ms * MS
        assert link.state() == link.message(NOW + ms * MS).state == state


def test_fresh_telemetry_is_a_sign_of_life_and_old_telemetry_is_none() -> None:
    clock = Clock()
    link = LinkMonitor(steady_ns=clock)
    link.exchanged(Exchange(NOW, NOW + MS, NOW + MS, NOW + 2 * MS))
    link.telemetry(1, NOW, NOW + 251 * MS)
    assert link.state() is LinkState.LOST
    link.telemetry(2, NOW + 10 * MS, NOW + 255 * MS)
    assert link.state() is LinkState.GOOD


@pytest.mark.parametrize("hour", [3_600_000 * MS, -3_600_000 * MS])
def test_a_system_clock_set_by_an_hour_changes_neither_state_nor_outages(hour: int) -> None:
    clock = Clock()
    link = LinkMonitor(steady_ns=clock)
    link.exchanged(Exchange(NOW, NOW + MS, NOW + MS, NOW + 2 * MS))
    for k in range(300):
        clock.now = k * 10 * MS
        station_ns = NOW + clock.now + (hour if k >= 100 else 0)
        if k == 150:  # requested once a second
            link.exchanged(Exchange(station_ns, *2 * (NOW + clock.now + MS,), station_ns + 2 * MS))
        if k % 5 == 0:
            link.alive()
        shown = link.telemetry(k, NOW + clock.now, station_ns + MS)
        assert shown or (hour > 0 and 100 <= k < 150), k
    message = link.message(station_ns + MS)
    assert (message.state, message.outages) == ("good", 0)
    assert message.age == pytest.approx(0.001, abs=1e-4)
    assert message.telemetry_rate == pytest.approx(100, abs=1)
    clock.now += 201 * MS
    assert link.state() is LinkState.DEGRADED


def test_the_message_holds_finite_numbers_before_anything_came() -> None:
    message = LinkMonitor().message(NOW)
    assert message.state == "lost"
    assert 0 <= message.age < 1e12
    assert (message.loss, message.telemetry_rate, message.jitter) == (0, 0, 0)
