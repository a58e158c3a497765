"""Messages that leave the vehicle: telemetry packets, the slow topics at their rates, heartbeats.

Everything is encoded once and also written to the onboard log. While the station is not received,
each topic sends at most five messages a second by radio, as a probe; the log still gets all.
"""

from __future__ import annotations

import queue
import struct
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Protocol

import msgspec
import numpy as np

from control.behaviors.table import BehaviorName
from quadrotor.records import TICK, Record, offset_of
from vehicle import mailbox
from vehicle.modes import ControlMode, Flag, Mode
from vehicle.processes.config import PACKETS_A_SECOND
from vehicle_link import telemetry
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.messages import encode_change
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import encode_reading
from vehicle_link.topics.status import (
    encode_batteries,
    encode_estimators,
    encode_event,
    encode_pressures,
    encode_status,
)
from vehicle_link.topics.table import TOPICS

if TYPE_CHECKING:
    from vehicle_link.transport.node import Node
    from vehicle_link.transport.publisher import OtherPath

NOMINAL_RATE = 500.0  # Hz, until the loop has measured its own
PROBE_NS = 200_000_000
STALE_NS = 200_000_000  # older ticks are only logged
FLOWN_ON = "estimation.estimator"
"""Name of the parameter that selects the estimator of the topic `estimator`."""

_STABLE = ~int(
    Flag.SATURATED | Flag.TILT_LIMITED
)  # the others may change every tick: no reason to publish
# Plain numbers, as an IntFlag costs half a microsecond per operation.
_FLAGS = [(int(flag), str(flag.name).lower()) for flag in Flag]
_PERIOD_NS = {name: round(1e9 / topic.rate) for name, topic in TOPICS.items() if topic.rate}
# mode, behavior, armed, airborne, flags, parameter_revision: unpacked at once, because reading a
# structured record field by field takes 2 µs.
_STATUS = struct.Struct("<5B3x2I")
_STATUS_OFFSET = offset_of(TICK, "status")


class Radio(Protocol):
    """One publisher per topic; `put` may take a millisecond."""

    def put(self, topic: str, payload: bytes, source_ns: int) -> None: ...


class Log(Protocol):
    """Log of every message; `topic` without namespace."""

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None: ...


class Clock(Protocol):
    """The vehicle's clock."""

    def now_ns(self) -> int: ...


class Station(Protocol):
    """The station that holds the vehicle, as far as it is known."""

    @property
    def is_lost(self) -> bool: ...

    @property
    def holder(self) -> int:
        """Return its instance; 0 when none is connected."""
        ...


class Publisher:
    """Publisher of all topics, for the comms thread alone.

    Args:
        radio: None in simulated time, where nothing listens: only the log is written.
        station: None in simulated time.
        estimator: returns the estimator in use.
        instance: of the vehicle.
        packets: telemetry packets a second. No other topic is sent more often; if there are fewer
            packets than usual, at most half as often, except heartbeats.
    """

    def __init__(
        self,
        radio: Radio | None,
        log: Log,
        clock: Clock,
        vehicle: str,
        *,
        estimator: Callable[[], str],
        station: Station | None = None,
        instance: int = 0,
        packets: int = PACKETS_A_SECOND,
    ) -> None:
        self._estimator, self._station, self._instance = estimator, station, instance
        self._packets = packets
        shortest = dict.fromkeys(
            _PERIOD_NS, (1.0 if packets >= PACKETS_A_SECOND else 2.0) / packets
        )
        shortest["vehicle_heartbeat"] = 1.0 / packets
        self._period_ns = {
            topic: max(period, round(1e9 * shortest[topic])) for topic, period in _PERIOD_NS.items()
        }
        self._radio = radio
        self._log = log
        self._clock = clock
        self._vehicle = vehicle
        self._pending: list[Record] = []
        self._pending_count = 0
        self._packet_size = telemetry.SAMPLES_A_PACKET
        self.tick_rate = NOMINAL_RATE
        """The rate in Hz, as the loop measured it last."""
        self._packet = self._heartbeat = 0
        self._due_ns: dict[str, int] = {}
        self._probe_ns: dict[str, int] = {}
        self._status_key: tuple[int, ...] = ()

    def ticks(self, ticks: Record) -> None:
        """Publish the ticks read just now, shape (N,), N ≥ 1, oldest first."""
        stamps = ticks["imu"]["stamp_ns"]
        newest = int(stamps[-1])
        if self._radio is not None:
            oldest = newest - STALE_NS
            fresh = ticks if stamps[0] >= oldest else ticks[stamps >= oldest]  # copying is slow
            self._telemetry(self._radio, fresh)
        last = ticks[-1:]
        key = _status_key(ticks)
        if self._due("status", newest) or key != self._status_key:
            self._status_key = key
            self._send("status", self._status(last), newest)
        if self._due("estimator", newest):
            self._send("estimator", encode_estimators(last, self._estimator())[0], newest)
        for topic, encode in (("battery", encode_batteries), ("pressure", encode_pressures)):
            if self._due(topic, newest):
                self._send(topic, encode(last, self._vehicle)[0], newest)

    def answered(self) -> None:
        """Publish a status with the next ticks, for clients that wait for a command's effect."""
        self._status_key = ()

    @property
    def next_packet_s(self) -> float:
        """Return the s from the last read until the next telemetry packet's ticks exist."""
        return (self._packet_size - self._pending_count) / self.tick_rate

    def heartbeat(self) -> None:
        """Send a heartbeat when one is due, with or without ticks; call it often.

        It uses the computer's clock, as simulated time may not advance until a heartbeat has
        arrived.
        """
        now_ns = self._clock.now_ns()
        if self._radio is not None and self._due("vehicle_heartbeat", time.monotonic_ns()):
            self._heartbeat += 1
            holder = self._station.holder if self._station is not None else 0
            payload = encode_heartbeat(self._heartbeat, now_ns, self._instance, holder)
            self._radio.put("vehicle_heartbeat", payload, now_ns)

    def event(self, event: mailbox.Event) -> None:
        payload = encode_event(
            event.stamp_ns, event.level, event.text, f"{self._vehicle}.vehicle", event.kinds
        )
        self._send("events", payload, event.stamp_ns, always=True)

    def parameter_change(self, change: ParameterChange) -> None:
        payload = encode_change(msgspec.structs.replace(change, instance=self._instance))
        self._send("parameter_changes", payload, change.stamp_ns, always=True)

    def reading(self, judged: Record) -> None:
        """Log a JUDGED_READING (1,), and send it if its sensor's last one is a period ago."""
        topic, payload = encode_reading(judged)
        stamp_ns = int(judged["stamp_ns"][0])
        self._send(topic, payload, stamp_ns, by_radio=self._due(topic, stamp_ns))

    def bearing_pose(self, payload: bytes, stamp_ns: int) -> None:
        self._send("bearing_pose", payload, stamp_ns)

    def _telemetry(self, radio: Radio, ticks: Record) -> None:
        if self._pending and _too_old(self._pending[0], ticks):
            self._pending.clear()
            self._pending_count = 0
        self._pending.append(ticks)
        self._pending_count += len(ticks)
        self.tick_rate = float(ticks["status"]["tick_rate"][-1]) or NOMINAL_RATE
        size = self._packet_size = samples_a_packet(self.tick_rate, self._packets)
        if self._pending_count < size:
            return
        # Joined as bytes: numpy's concatenate takes long to find that all have the same type.
        joined = b"".join(some.tobytes() for some in self._pending)
        waiting = np.frombuffer(joined, self._pending[0].dtype)
        for start in range(0, len(waiting) - size + 1, size):
            group = waiting[start : start + size]
            stamp_ns = int(group["imu"]["stamp_ns"][-1])
            if self._may_send("telemetry", stamp_ns):
                radio.put("telemetry", telemetry.pack(group, self._packet), stamp_ns)
                self._packet += 1
        rest = waiting[len(waiting) // size * size :]
        self._pending = [rest] if len(rest) else []
        self._pending_count = len(rest)

    def _status(self, tick: Record) -> bytes:
        status = tick["status"][0]
        return encode_status(
            tick,
            Mode(status["mode"]).name.lower(),
            BehaviorName(status["behavior"]).name.lower(),
            flag_names(int(status["flags"])),
            ControlMode(status["control_mode"]).name.lower(),
            self._instance,
        )

    def _due(self, topic: str, now_ns: int) -> bool:
        """Return True once per period of the topic, with deadlines that keep the mean rate."""
        period = self._period_ns[topic]
        late = now_ns - self._due_ns.get(topic, now_ns)
        if late < -period:  # the clock was set back
            late = 0
        if late < 0:
            return False
        # More than a period late: restart the deadlines instead of catching up.
        self._due_ns[topic] = now_ns + period - (late if late < period else 0)
        return True

    def _may_send(self, topic: str, stamp_ns: int) -> bool:
        if self._station is None or not self._station.is_lost:
            return True
        if 0 <= stamp_ns - self._probe_ns.get(topic, 0) < PROBE_NS:
            return False
        self._probe_ns[topic] = stamp_ns
        return True

    def _send(
        self,
        topic: str,
        payload: bytes,
        stamp_ns: int,
        *,
        always: bool = False,
        by_radio: bool = True,
    ) -> None:
        if by_radio and self._radio is not None and (always or self._may_send(topic, stamp_ns)):
            self._radio.put(topic, payload, stamp_ns)
        type_name = TOPICS[topic].type_name
        self._log.message(topic, type_name, payload, stamp_ns, self._clock.now_ns())


def samples_a_packet(tick_rate: float, packets: int = PACKETS_A_SECOND) -> int:
    """Return the samples per packet for this many packets a second, within one datagram."""
    return max(1, min(telemetry.SAMPLES_A_PACKET, round(tick_rate / packets)))


@cache
def flag_names(flags: int) -> Sequence[str]:
    """Return the lower-case names of the flags that are set."""
    return [name for bit, name in _FLAGS if flags & bit]


def _status_key(ticks: Record) -> tuple[int, ...]:
    """Return those fields of the newest status that are published as soon as they change."""
    mode, behavior, armed, airborne, control_mode, flags, revision = _STATUS.unpack_from(
        ticks[-1:].tobytes(), _STATUS_OFFSET
    )
    return flags & _STABLE, mode, behavior, armed, airborne, control_mode, revision


def _too_old(first: Record, ticks: Record) -> bool:
    return bool(ticks["imu"]["stamp_ns"][0] - first["imu"]["stamp_ns"][0] > STALE_NS)


WAITING_MAX = 1000


class LinkRadio:
    """Publishers of every topic of the table that the vehicle sends.

    Args:
        paths: other paths that the messages of a topic take as well.
    """

    def __init__(self, node: Node, paths: Mapping[str, OtherPath] | None = None) -> None:
        others = paths or {}
        self.lost = 0  # number of reliable messages lost, as the link was stalled
        rows = [topic for topic in TOPICS.values() if topic.sender == "vehicle"]
        self.publishers = {row.name: node.advertise(row, others.get(row.name)) for row in rows}
        """Publishers by topic."""
        self._patient = {row.name for row in rows if row.qos.reliable}
        self._queue: queue.Queue[tuple[str, bytes, int] | None] = queue.Queue(WAITING_MAX)
        self._thread = threading.Thread(target=self._run, name="reliable", daemon=True)
        self._thread.start()

    def put(self, topic: str, payload: bytes, source_ns: int) -> None:
        """Send now, or as soon as the link has capacity."""
        if topic not in self._patient:
            self.publishers[topic].put(payload, source_ns)
            return
        try:
            self._queue.put_nowait((topic, payload, source_ns))
        except queue.Full:
            self.lost += 1

    def close(self, timeout_s: float = 0.5) -> None:
        """Send the queued messages, as far as the time allows."""
        try:
            self._queue.put_nowait(None)
        except queue.Full:
            return
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (item := self._queue.get()) is not None:
            topic, payload, source_ns = item
            self.publishers[topic].put(payload, source_ns)
