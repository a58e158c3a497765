"""What the station says of the link, on clocks that differ."""

from __future__ import annotations

import pytest

from console.link_monitor import LinkMonitor
from vehicle_link.heartbeat import LinkState
from vehicle_link.time_sync import Exchange

NOW = 1_700_000_000_000_000_000
AHEAD = 5_000_000_000_000
MS = 1_000_000


def synchronised() -> LinkMonitor:
    link = LinkMonitor()
    link.exchanged(Exchange(NOW, NOW + AHEAD + MS, NOW + AHEAD + MS, NOW + 2 * MS))
    return link


def test_telemetry_under_way_for_too_long_is_not_shown() -> None:
    link = synchronised()
    assert link.telemetry(1, NOW + AHEAD, NOW + 249 * MS)
    assert not link.telemetry(2, NOW + AHEAD + 10 * MS, NOW + 10 * MS + 251 * MS)
    assert link.telemetry(3, NOW + AHEAD + 300 * MS, NOW + 310 * MS)


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
    link = LinkMonitor()
    assert link.state(NOW) is LinkState.LOST
    link.heartbeat(NOW)
    assert link.state(NOW + 299 * MS) is LinkState.GOOD
    assert link.message(NOW + 301 * MS).state == "degraded"
    assert link.message(NOW + 1001 * MS).state == "lost"


def test_the_message_holds_finite_numbers_before_anything_came() -> None:
    message = LinkMonitor().message(NOW)
    assert message.state == "lost"
    assert 0 <= message.age < 1e12
    assert (message.loss, message.telemetry_rate, message.jitter) == (0, 0, 0)
