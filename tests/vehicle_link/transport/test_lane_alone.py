"""An end counts as deaf when the other is heard by the lane alone, and never else."""

from __future__ import annotations

import pytest

from console.link import monitor
from vehicle.comms import lane
from vehicle_link.lane.lane_alone import SILENT_AFTER, LaneAlone
from vehicle_link.transport import radio

PERIOD = 0.05
DEAF_AFTER = lane.DEAF_AFTER
OURS, OTHERS = b"ours", b"others"


class Flight:
    """Heartbeats of stations, and when the vehicle counts as deaf."""

    def __init__(self) -> None:
        self.now = 100.0
        self.path = LaneAlone(lambda: self.now)

    def hear(self, seconds: float, *, lane: bytes = OURS, zenoh: bytes = OURS) -> float | None:
        """Return the time of the first instant of deafness, s from the beginning; None if none."""
        began = self.now
        while self.now - began < seconds:
            self.now += PERIOD
            if lane:
                self.path.by_lane(lane)
            if zenoh:
                self.path.by_zenoh(zenoh)
            if self.path.lasted > DEAF_AFTER:
                return self.now - began
        return None


def test_a_vehicle_that_only_the_lane_reaches_is_deaf_after_two_seconds() -> None:
    flight = Flight()
    assert flight.hear(10.0) is None
    assert flight.hear(10.0, zenoh=b"") == pytest.approx(DEAF_AFTER, abs=2 * PERIOD)


def test_the_heartbeats_of_another_station_do_not_count() -> None:
    flight = Flight()
    assert flight.hear(1.0) is None
    assert flight.hear(10.0, zenoh=OTHERS) == pytest.approx(DEAF_AFTER, abs=2 * PERIOD)


@pytest.mark.parametrize("lane", [b"", OURS])
def test_a_lost_link_is_no_deafness_and_zenoh_may_come_back_later_than_the_lane(
    lane: bytes,
) -> None:
    flight = Flight()
    assert flight.hear(1.0, lane=lane) is None
    assert flight.hear(30.0, lane=b"", zenoh=b"") is None
    assert flight.hear(DEAF_AFTER - PERIOD, zenoh=b"") is None
    assert flight.hear(5.0) is None
    assert flight.hear(SILENT_AFTER / 2, lane=b"", zenoh=b"") is None
    assert flight.hear(10.0, zenoh=b"") is not None


def test_a_station_that_is_started_anew_has_its_own_time() -> None:
    flight = Flight()
    assert flight.hear(1.0) is None
    assert flight.hear(DEAF_AFTER - PERIOD, lane=OTHERS, zenoh=b"") is None
    assert flight.hear(5.0, lane=OTHERS, zenoh=OTHERS) is None


def test_a_vehicle_without_a_lane_is_never_deaf() -> None:
    assert Flight().hear(30.0, lane=b"") is None


def test_the_radio_opens_its_session_again_before_a_station_counts_as_deaf() -> None:
    assert monitor.DEAF_AFTER > radio.REOPEN_AFTER + radio.LOOK + radio.ANSWER_WITHIN
