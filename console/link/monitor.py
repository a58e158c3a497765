"""The link to the vehicle as seen by the station: state, clock offset, quality of telemetry."""

from __future__ import annotations

import math
from collections.abc import Callable

from console.link.outages import Outages
from console.link.permission import CommandPermission
from console.link.telemetry_quality import TelemetryWindow
from vehicle_link.clock import monotonic, monotonic_ns, time_ns
from vehicle_link.lane.lane_alone import LaneAlone
from vehicle_link.messages import header, new
from vehicle_link.messages.records import LinkStatus
from vehicle_link.topics.control_inputs import decode_heartbeat
from vehicle_link.transport.heartbeat import HeartbeatMonitor, LinkState
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.time_sync import ClockOffset, Exchange

OLDEST_NS = 250_000_000
"""Age in ns; older telemetry is recorded but not shown."""
CLOCK_SET_NS = 1_000_000_000
"""Clocks of one computer differ by less, in ns, unless it was set."""
DEAF_AFTER = 5.0
"""Seconds of messages by the lane alone after which this process counts as deaf: by then the radio
has opened its session again, which restores a link that hangs."""


class LinkMonitor:
    """State of the link. Written by several threads; every method is a few assignments on plain
    objects.

    Times named `station_ns` are time.time_ns of this process. Durations are measured on
    `steady_ns`, because the system's clock may be set while the vehicle flies.

    Args:
        vehicle: its name.
        instance: of this station's process.
    """

    def __init__(
        self, vehicle: str = "quad1", instance: int = 0, steady_ns: Callable[[], int] = monotonic_ns
    ) -> None:
        self.permission = CommandPermission(vehicle, instance)
        self.radio: Radio | None = None
        self.path = ""
        """Path of the newest telemetry: datagram or quic."""
        self._session_message_at: float | None = None
        self._lane_message_at: float | None = None
        self._alone = LaneAlone()
        self._heartbeats = HeartbeatMonitor()
        self._clock = ClockOffset()
        self._telemetry = TelemetryWindow()
        self._steady_ns = steady_ns
        self._started_ns = steady_ns()
        self._outages = Outages(self._started_ns)

    def follow(self, radio: Radio) -> None:
        """Follow the state of this radio from now on: it has been dialled."""
        self.radio = radio

    def note_session_message(self) -> None:
        """Note that a message arrived from the vehicle over its Zenoh session."""
        self._session_message_at = monotonic()
        self._alone.by_zenoh()

    def session_silence(self) -> float:
        """Return the seconds since the last message over Zenoh; inf before the first."""
        return (
            math.inf if self._session_message_at is None else monotonic() - self._session_message_at
        )

    def note_lane_message(self) -> None:
        """Note that a message arrived from the vehicle over the lane."""
        self._lane_message_at = monotonic()
        self._alone.by_lane()

    def lane_silence(self) -> float:
        """Return the seconds since the last message over the lane; inf before the first."""
        return math.inf if self._lane_message_at is None else monotonic() - self._lane_message_at

    @property
    def is_deaf(self) -> bool:
        """Return whether only the lane delivers, so that Zenoh hears nothing in this process.

        Zenoh receives in threads of its own. Without memory they end one by one, and nobody's
        commands arrive, while heartbeats and telemetry go on.
        """
        return self._alone.lasted > DEAF_AFTER

    def beat(self, payload: bytes) -> None:
        """Handle the vehicle's heartbeat, over either path. Raises LinkError."""
        self.permission.heartbeat(decode_heartbeat(payload), monotonic_ns())
        self.alive()

    def alive(self) -> None:
        """Note that the vehicle was received just now."""
        now_ns = self._steady_ns()
        self._heartbeats.note_received(now_ns)
        self._outages.note_received(now_ns)

    def exchanged(self, exchange: Exchange) -> None:
        """Handle an answered time synchronisation."""
        self._clock.add(exchange)

    def telemetry(
        self, sequence: int, stamp_ns: int, station_ns: int, now_ns: int | None = None
    ) -> bool:
        """Handle a packet with the vehicle's stamp of its newest sample; return whether to show it.

        A packet is not shown when a newer one arrived before, or when it is more than 250 ms old at
        `now_ns`, which is later than its arrival if it had to wait for the processor here.
        """
        newest = self._telemetry.feed(sequence, stamp_ns, station_ns, self._steady_ns())
        now_ns = station_ns if now_ns is None else now_ns
        fresh = now_ns - self._clock.to_client(stamp_ns) <= OLDEST_NS
        if newest and fresh and self._clock.known:
            self.alive()
        return newest and (fresh or not self._clock.known)

    @property
    def is_up(self) -> bool:
        """Return whether there is a link, with or without heartbeats."""
        if self.radio is not None:
            return self.radio.connected
        return self.state() is not LinkState.LOST

    def problem(self) -> str:
        """Return why the vehicle is not commanded although the link is up."""
        return self.permission.problem(monotonic_ns())

    def refusal(self, command: str) -> str:
        """Return why this command is not sent to the vehicle; "" when it is."""
        if command != "emergency" and self.state() is LinkState.LOST:
            return "the link to the vehicle is lost; nothing was sent"
        return self.permission.refusal(command, monotonic_ns())

    def state(self) -> LinkState:
        return self._heartbeats.state(self._steady_ns())

    @property
    def clock_known(self) -> bool:
        return self._clock.known

    def vehicle_ns(self, station_ns: int | None = None) -> int:
        """Return the vehicle's clock, now or at `station_ns`; the station's own until
        it is known.
        """
        return self._clock.to_server(time_ns() if station_ns is None else station_ns)

    def stamp_of_simulator(self, stamp_ns: int) -> int:
        """Return a stamp of the simulator as one of the vehicle's clock.

        Both run on this computer, so that their clocks are the same unless its clock was set
        between their starts.
        """
        offset_ns = self._clock.offset_ns
        return stamp_ns if abs(offset_ns) < CLOCK_SET_NS else stamp_ns + offset_ns

    def deadline_ns(self, seconds: float) -> int:
        """Return the vehicle's time so many seconds from now; 0 while its clock is not known."""
        return self.vehicle_ns() + round(1e9 * seconds) if self._clock.known else 0

    def message(self, station_ns: int) -> LinkStatus:
        """Return the quadlab_msgs/LinkStatus."""
        now_ns = self._steady_ns()
        quality = self._telemetry.quality(now_ns)
        outages = self._outages.figures(now_ns)
        newest_ns = self._telemetry.newest_stamp_ns
        # Before the first packet, the time we have waited for one.
        age_ns = now_ns - self._started_ns
        if newest_ns is not None:
            age_ns = station_ns - self._clock.to_client(newest_ns)
        return new(
            "quadlab_msgs/LinkStatus",
            header=header(self._clock.to_server(station_ns)),
            state=str(self.state()),
            round_trip=self._clock.round_trip_ns * 1e-9,
            clock_offset=self._clock.offset_ns * 1e-9,
            jitter=quality.jitter,
            age=max(0, age_ns) * 1e-9,
            loss=quality.loss,
            telemetry_rate=quality.rate,
            state_duration=self._outages.state_duration(now_ns),
            outages=outages.count,
            outage_last=outages.last,
            outage_longest=outages.longest,
            outage_total=outages.total,
            address="" if self.radio is None else self.radio.address,
            access=self.permission.access,
            path=self.path if quality.rate else "",
            problem=self.problem() or self.permission.unreachable_reason,
            reopened=0 if self.radio is None else self.radio.reopened,
        )
