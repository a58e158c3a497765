"""A flight as logged by the vehicle, and as recorded by a station over a link with drop-outs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from flight_log import LogWriter
from quadrotor.records import TICK, Record
from vehicle_link.messages.cdr_layout import payloads_of
from vehicle_link.telemetry import SAMPLES_A_PACKET, pack, unpack
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.table import TOPICS
from vehicle_link.topics.ticks import (
    actuator_messages,
    imu_messages,
    reference_messages,
    state_messages,
)

START_NS = 1_800_000_000_000_000_000  # the vehicle's clock
OFFSET_NS = -3_600_000_000_000  # the vehicle's clock minus the station's: an hour off
WAY_NS = 4_000_000
PERIOD_NS = 2_000_000
VEHICLE = "quad1"

Mask = npt.NDArray[np.bool_]


def flown(count: int, seed: int = 1, start_ns: int = START_NS) -> Record:
    """Return TICK records, shape (count,), of random numbers, with stamps that jitter a little."""
    random = np.random.default_rng(seed)
    ticks = np.zeros(count, TICK)
    for part in ("state", "reference", "imu", "actuators"):
        for name in ticks[part].dtype.names or ():
            if name != "stamp_ns":
                ticks[part][name] = random.normal(size=ticks[part][name].shape)
    jitter = random.integers(-200_000, 200_000, count)
    ticks["imu"]["stamp_ns"] = start_ns + PERIOD_NS * np.arange(count) + jitter
    ticks["status"]["armed"] = True
    return ticks


@dataclass
class Flight:
    """Flight, and the station's part of it.

    Args:
        heard: which ticks have reached the station.
    """

    ticks: Record
    heard: Mask
    others: list[tuple[str, bytes, int]] = field(default_factory=list)
    """Topic, payload and stamp of the vehicle's other messages."""

    @property
    def stamps(self) -> npt.NDArray[np.int64]:
        stamps: npt.NDArray[np.int64] = self.ticks["imu"]["stamp_ns"]
        return stamps

    def log_onboard(self, path: Path, close: bool = True) -> None:
        """Write batches of ticks as the onboard log does: topic by topic, read 10 ms later."""
        writer = LogWriter(path, {"vehicle": VEHICLE, "recorder": "onboard"}, {"a.json": b"{}"})
        others = sorted(self.others, key=lambda one: one[2])
        for begin in range(0, len(self.ticks), 10):
            batch = self.ticks[begin : begin + 10]
            log_ns = int(batch["imu"]["stamp_ns"][-1]) + 500_000
            for topic, payloads in encoded(batch).items():
                for stamp, payload in zip(batch["imu"]["stamp_ns"].tolist(), payloads, strict=True):
                    _write(writer, topic, payload, log_ns, stamp)
            while others and (others[0][2] <= log_ns or begin + 10 >= len(self.ticks)):
                topic, payload, stamp = others.pop(0)
                _write(writer, topic, payload, max(log_ns, stamp), stamp)
        if close:
            writer.close()
        else:
            writer.flush()

    def record(self, path: Path, heard_others: frozenset[int] = frozenset()) -> None:
        """Record as the station does: packets of five ticks of float32, some of which are lost."""
        random = np.random.default_rng(7)
        messages = []
        for begin in range(0, len(self.ticks), SAMPLES_A_PACKET):
            part = slice(begin, begin + SAMPLES_A_PACKET)
            if not self.heard[part].all():
                continue
            _, ticks = unpack(pack(self.ticks[part], begin))
            newest = int(ticks["imu"]["stamp_ns"][-1])
            log_ns = newest - OFFSET_NS + WAY_NS + int(random.integers(0, 3_000_000))
            for topic, payloads in encoded(ticks).items():
                for stamp, payload in zip(ticks["imu"]["stamp_ns"].tolist(), payloads, strict=True):
                    messages.append((log_ns, topic, payload, stamp))
        for number, (topic, payload, stamp) in enumerate(self.others):
            if number in heard_others:
                messages.append((stamp - OFFSET_NS + WAY_NS, topic, payload, stamp))
        last = int(self.stamps[-1]) + 1_000_000_000  # a run ends a second after disarming
        for stamp in range(int(self.stamps[0]), last, 50_000_000):
            payload = encode_heartbeat(1, stamp)
            messages.append((stamp - OFFSET_NS, "station_heartbeat", payload, stamp))
        run = {"vehicle": VEHICLE, "operator": "ada", "run_id": path.stem}
        with LogWriter(path, run, {"parameters.json": b"{}"}) as writer:
            # The receptions of different threads overlap a little.
            for log_ns, topic, payload, stamp in sorted(
                messages, key=lambda one: one[0] + (400_000 if one[1] == "state" else 0)
            ):
                _write(writer, topic, payload, log_ns, stamp)


def encoded(ticks: Record) -> dict[str, list[bytes]]:
    return {
        "state": payloads_of(state_messages(ticks, VEHICLE)),
        "reference": payloads_of(reference_messages(ticks)),
        "imu": payloads_of(imu_messages(ticks, VEHICLE)),
        "actuators": payloads_of(actuator_messages(ticks, VEHICLE)),
    }


def with_holes(count: int, seed: int, holes: int = 3) -> Mask:
    """Return True for the ticks that arrived, with random holes, maybe at the very first."""
    random = np.random.default_rng(seed)
    heard = np.ones(count, np.bool_)
    for _ in range(holes):
        begin = int(random.integers(0, count))
        heard[begin : begin + int(random.integers(1, count // 4))] = False
    # A packet arrives or is lost as a whole.
    for begin in range(0, count, SAMPLES_A_PACKET):
        part = slice(begin, begin + SAMPLES_A_PACKET)
        heard[part] = heard[part].all()
    heard[count // 2 : count // 2 + SAMPLES_A_PACKET] = True  # some have arrived
    return heard


def _write(writer: LogWriter, topic: str, payload: bytes, log_ns: int, stamp: int) -> None:
    writer.write(f"/{VEHICLE}/{topic}", TOPICS[topic].type_name, payload, log_ns, stamp)
