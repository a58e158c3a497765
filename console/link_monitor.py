"""The link to the vehicle as the station sees it: state, clock offset, telemetry's quality."""

from __future__ import annotations

import time
from typing import Any

from console.outages import Outages
from console.telemetry_window import TelemetryWindow
from vehicle_link.heartbeat import HeartbeatMonitor, LinkState
from vehicle_link.messages import header, new
from vehicle_link.time_sync import ClockOffset, Exchange

OLDEST_NS = 250_000_000
"""Telemetry older than this is recorded but not shown."""


class LinkMonitor:
    """Fed from several threads; every method is a few assignments on plain objects.

    Times named `station_ns` are time.time_ns of this process.
    """

    def __init__(self) -> None:
        self._heartbeats = HeartbeatMonitor()
        self._clock = ClockOffset()
        self._telemetry = TelemetryWindow()
        self._started_ns = time.time_ns()
        self._outages = Outages(self._started_ns)

    def heartbeat(self, station_ns: int) -> None:
        """The vehicle's heartbeat came."""
        self._heartbeats.heard(station_ns)
        self._outages.heard(station_ns)

    def exchanged(self, exchange: Exchange) -> None:
        """A time synchronisation was answered."""
        self._clock.add(exchange)

    def telemetry(self, sequence: int, stamp_ns: int, station_ns: int) -> bool:
        """A packet with the vehicle's stamp of its newest sample came; True if it is to be shown.

        It is not when a newer one came before, or when it was under way for more than 250 ms.
        """
        newest = self._telemetry.feed(sequence, stamp_ns, station_ns)
        fresh = station_ns - self._clock.to_client(stamp_ns) <= OLDEST_NS
        return newest and (fresh or not self._clock.known)

    def state(self, station_ns: int) -> LinkState:
        return self._heartbeats.state(station_ns)

    @property
    def clock_known(self) -> bool:
        return self._clock.known

    def vehicle_ns(self) -> int:
        """The vehicle's clock now; the station's own until it is known."""
        return self._clock.to_server(time.time_ns())

    def message(self, station_ns: int) -> Any:
        """quadlab_msgs/LinkStatus."""
        quality = self._telemetry.quality(station_ns)
        outages = self._outages.figures(station_ns)
        newest_ns = self._telemetry.newest_stamp_ns
        # Before the first packet, for as long as we have waited for one.
        since_ns = self._started_ns if newest_ns is None else self._clock.to_client(newest_ns)
        return new(
            "quadlab_msgs/LinkStatus",
            header=header(self._clock.to_server(station_ns)),
            state=str(self.state(station_ns)),
            round_trip=self._clock.round_trip_ns * 1e-9,
            clock_offset=self._clock.offset_ns * 1e-9,
            jitter=quality.jitter,
            age=max(0, station_ns - since_ns) * 1e-9,
            loss=quality.loss,
            telemetry_rate=quality.rate,
            state_duration=self._outages.state_duration(station_ns),
            outages=outages.count,
            outage_last=outages.last,
            outage_longest=outages.longest,
            outage_total=outages.total,
        )
