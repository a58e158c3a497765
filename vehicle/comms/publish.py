"""Messages that leave the vehicle: telemetry packets, the slow topics at their rates, heartbeats.

Everything is encoded once and goes to the onboard log too. While the station is not received, the
radio gets at most five messages a second of each topic, as a probe; the log still gets all.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Sequence
from typing import Protocol

import msgspec
import numpy as np

from control.behaviors.table import BehaviorName
from quadrotor.records import TICK, Record, offset_of
from vehicle.flight.modes import ControlMode, Flag, Mode
from vehicle.processes import mailbox
from vehicle.processes.config import PACKETS_A_SECOND
from vehicle_link import telemetry, topics
from vehicle_link.parameters.change import ParameterChange

NOMINAL_RATE = 500.0  # Hz, until the loop has measured its own
PROBE_NS = 200_000_000
STALE_NS = 200_000_000  # ticks older than this are for the log only
FLOWN_ON = "estimation.estimator"
"""The parameter that names the estimator of the topic `estimator`."""

_STABLE = ~int(
    Flag.SATURATED | Flag.TILT_LIMITED
)  # the others may change every tick: no reason to publish
_PERIOD_NS = {name: round(1e9 / topic.rate) for name, topic in topics.TOPICS.items() if topic.rate}
# mode, behavior, armed, airborne, flags, parameter_revision: unpacked at once, because reading a
# structured record field by field takes 2 µs.
_STATUS = struct.Struct("<5B3x2I")
_STATUS_OFFSET = offset_of(TICK, "status")


class Radio(Protocol):
    """One publisher a topic; `put` may take a millisecond."""

    def put(self, topic: str, payload: bytes, source_ns: int) -> None: ...


class Log(Protocol):
    """Keeps every message; `topic` without namespace."""

    def message(
        self, topic: str, type_name: str, payload: bytes, source_ns: int, log_ns: int
    ) -> None: ...


class Clock(Protocol):
    """The vehicle's clock."""

    def now_ns(self) -> int: ...


class Publisher:
    """Owned by the comms thread; `event`, `parameter_change` and `bearing_pose` as well.

    Args:
        radio: None in simulated time, where no one listens: only the log is served.
        packets: of telemetry a second. No other topic comes more often; where there are fewer than
            usual, half as often at most, heartbeats apart.
    """

    def __init__(
        self,
        radio: Radio | None,
        log: Log,
        clock: Clock,
        vehicle: str,
        packets: int = PACKETS_A_SECOND,
    ) -> None:
        self._packets = packets
        self._beat_ns = round(1e9 / packets)
        self._shortest_ns = round((1e9 if packets >= PACKETS_A_SECOND else 2e9) / packets)
        self._radio = radio
        self._log = log
        self._clock = clock
        self._vehicle = vehicle
        self._pending: list[Record] = []
        self._pending_count = 0
        self._packet_size = telemetry.SAMPLES_A_PACKET
        self._tick_rate = NOMINAL_RATE
        self._packet = 0
        self._heartbeat = 0
        self._due_ns: dict[str, int] = {}
        self._probe_ns: dict[str, int] = {}
        self._status_key: tuple[int, ...] = ()
        self.station_lost = False
        self.instance, self.holder = 0, 0  # of the vehicle, of the station that has it
        self.estimator = ""
        """The one flown on, as `FLOWN_ON` says; followed from its changes."""

    def ticks(self, ticks: Record) -> None:
        """Publish the ticks read just now, shape (N,), N ≥ 1, oldest first."""
        stamps = ticks["imu"]["stamp_ns"]
        newest = int(stamps[-1])
        if self._radio is not None:
            oldest = newest - STALE_NS
            fresh = ticks if stamps[0] >= oldest else ticks[stamps >= oldest]  # a copy takes long
            self._telemetry(self._radio, fresh)
        last = ticks[-1:]
        key = _status_key(ticks)
        if self._due("status", newest) or key != self._status_key:
            self._status_key = key
            self._send("status", self._status(last), newest)
        if self._due("estimator", newest):
            self._send("estimator", topics.encode_estimators(last, self.estimator)[0], newest)
        if self._due("battery", newest):
            self._send("battery", topics.encode_batteries(last, self._vehicle)[0], newest)
        if self._due("pressure", newest):
            self._send("pressure", topics.encode_pressures(last, self._vehicle)[0], newest)

    @property
    def next_packet_s(self) -> float:
        """Return time until the ticks of the next telemetry packet are there, seen from the last
        read.
        """
        return (self._packet_size - self._pending_count) / self._tick_rate

    @property
    def tick_rate(self) -> float:
        """Return the rate in Hz, as the loop measured it last."""
        return self._tick_rate

    def heartbeat(self) -> None:
        """Call often; sends at its rate, with or without ticks.

        By the computer's time: simulated time may stand still until one has been heard.
        """
        now_ns = self._clock.now_ns()
        if self._radio is not None and self._due("vehicle_heartbeat", time.monotonic_ns()):
            self._heartbeat += 1
            payload = topics.encode_heartbeat(self._heartbeat, now_ns, self.instance, self.holder)
            self._radio.put("vehicle_heartbeat", payload, now_ns)

    def event(self, event: mailbox.Event) -> None:
        payload = topics.encode_event(
            event.stamp_ns, event.level, event.text, f"{self._vehicle}.vehicle"
        )
        self._send("events", payload, event.stamp_ns, always=True)

    def parameter_change(self, change: ParameterChange) -> None:
        if change.name == FLOWN_ON:
            self.estimator = str(change.new)
        change = msgspec.structs.replace(change, instance=self.instance)
        payload = topics.encode_parameter_change(change)
        self._send("parameter_changes", payload, change.stamp_ns, always=True)

    def bearing_pose(self, payload: bytes, stamp_ns: int) -> None:
        self._send("bearing_pose", payload, stamp_ns)

    def _telemetry(self, radio: Radio, ticks: Record) -> None:
        if self._pending and _too_old(self._pending[0], ticks):
            self._pending.clear()
            self._pending_count = 0
        self._pending.append(ticks)
        self._pending_count += len(ticks)
        self._tick_rate = float(ticks["status"]["tick_rate"][-1]) or NOMINAL_RATE
        size = self._packet_size = samples_a_packet(self._tick_rate, self._packets)
        if self._pending_count < size:
            return
        # By their bytes: numpy's concatenate takes long to see that all are of one type.
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
        return topics.encode_status(
            tick,
            Mode(status["mode"]).name.lower(),
            BehaviorName(status["behavior"]).name.lower(),
            flag_names(int(status["flags"])),
            ControlMode(status["control_mode"]).name.lower(),
            self.instance,
        )

    def _due(self, topic: str, now_ns: int) -> bool:
        """Return True once a period of the topic; deadlines are kept, so the mean rate is the
        rate.
        """
        period = _PERIOD_NS[topic]
        shortest = self._beat_ns if topic == "vehicle_heartbeat" else self._shortest_ns
        period = max(period, shortest)
        late = now_ns - self._due_ns.get(topic, now_ns)
        if late < -period:  # the clock was set back
            late = 0
        if late < 0:
            return False
        # More than a period late: start a new row of deadlines instead of catching up.
        self._due_ns[topic] = now_ns + period - (late if late < period else 0)
        return True

    def _may_send(self, topic: str, stamp_ns: int) -> bool:
        if not self.station_lost:
            return True
        if 0 <= stamp_ns - self._probe_ns.get(topic, 0) < PROBE_NS:
            return False
        self._probe_ns[topic] = stamp_ns
        return True

    def _send(self, topic: str, payload: bytes, stamp_ns: int, *, always: bool = False) -> None:
        if self._radio is not None and (always or self._may_send(topic, stamp_ns)):
            self._radio.put(topic, payload, stamp_ns)
        type_name = topics.TOPICS[topic].type_name
        self._log.message(topic, type_name, payload, stamp_ns, self._clock.now_ns())


def samples_a_packet(tick_rate: float, packets: int = PACKETS_A_SECOND) -> int:
    """Return how many samples a packet takes to make so many packets a second, as far as one
    datagram holds them.
    """
    return max(1, min(telemetry.SAMPLES_A_PACKET, round(tick_rate / packets)))


def flag_names(flags: int) -> Sequence[str]:
    """Return lower-case names of the flags that are set."""
    return [flag.name.lower() for flag in Flag if flags & flag and flag.name]


def _status_key(ticks: Record) -> tuple[int, ...]:
    """Return what of the newest tick's status is published when it changes."""
    mode, behavior, armed, airborne, control_mode, flags, revision = _STATUS.unpack_from(
        ticks[-1:].tobytes(), _STATUS_OFFSET
    )
    return flags & _STABLE, mode, behavior, armed, airborne, control_mode, revision


def _too_old(first: Record, ticks: Record) -> bool:
    return bool(ticks["imu"]["stamp_ns"][0] - first["imu"]["stamp_ns"][0] > STALE_NS)
