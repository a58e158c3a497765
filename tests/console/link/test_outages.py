"""Silences of the vehicle, counted as people would."""

from __future__ import annotations

import pytest

from console.link.monitor import LinkMonitor
from console.link.outages import OutageFigures, Outages

START = 1_700_000_000_000_000_000
MS = 1_000_000


def beating(outages: Outages, *times_ms: int) -> None:
    for ms in times_ms:
        outages.note_received(START + ms * MS)


def test_before_the_vehicle_was_heard_there_is_no_outage() -> None:
    outages = Outages(START)
    assert outages.figures(START + 60_000 * MS) == OutageFigures()
    assert outages.state_duration(START + 60_000 * MS) == pytest.approx(60.0)


def test_a_late_heartbeat_is_no_outage_and_a_silence_is_one() -> None:
    outages = Outages(START)
    beating(outages, 0, 50, 249)
    assert outages.figures(START + 300 * MS).count == 0
    beating(outages, 449, 500)
    found = outages.figures(START + 520 * MS)
    assert found.count == 1
    assert found.last == pytest.approx(0.200)


def test_longest_and_total_are_of_all_outages() -> None:
    outages = Outages(START)
    beating(outages, 0, 1500, 1550, 2050, 2100)
    found = outages.figures(START + 2150 * MS)
    assert found.count == 2
    assert (found.last, found.longest, found.total) == pytest.approx((0.5, 1.5, 2.0))


def test_an_outage_under_way_counts_and_grows_and_is_counted_once() -> None:
    outages = Outages(START)
    beating(outages, 0)
    during = [outages.figures(START + ms * MS) for ms in (199, 200, 2000)]
    assert [found.count for found in during] == [0, 1, 1]
    assert [found.last for found in during] == pytest.approx([0.0, 0.2, 2.0])
    beating(outages, 2500)
    after = outages.figures(START + 2500 * MS)
    assert after.count == 1
    assert after.total == pytest.approx(2.5)


def test_the_state_lasts_since_the_silence_began_or_ended() -> None:
    outages = Outages(START)
    beating(outages, 100, 150, 200)
    assert outages.state_duration(START + 250 * MS) == pytest.approx(0.15)
    assert outages.state_duration(START + 1200 * MS) == pytest.approx(1.0)
    beating(outages, 1300, 1350)
    assert outages.state_duration(START + 1400 * MS) == pytest.approx(0.1)


def test_heartbeats_out_of_order_change_nothing() -> None:
    outages = Outages(START)
    beating(outages, 0, 50, 20, 60)
    assert outages.figures(START + 70 * MS).count == 0
    assert outages.state_duration(START + 70 * MS) == pytest.approx(0.07)


def test_link_status_tells_of_outages() -> None:
    clock = [START]
    link = LinkMonitor(steady_ns=lambda: clock[0])
    for ms in (0, 1200, 1250, 1300):
        clock[0] = START + ms * MS
        if ms < 1300:
            link.alive()
    message = link.message(START + 1300 * MS)
    assert (message.state, message.outages) == ("good", 1)
    lengths = (message.outage_last, message.outage_longest, message.outage_total)
    assert lengths == pytest.approx((1.2, 1.2, 1.2))
    assert message.state_duration == pytest.approx(0.1)
