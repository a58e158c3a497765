"""A live log filled by hand, and its newest values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from quadrotor.records import TICK, Record
from tests.support.clock import Clock
from vehicle_link.messages import decode, encode
from vehicle_link.telemetry import SAMPLES_A_PACKET, pack
from web.latest import TICKS, Live
from web.live.signal_log import SignalLog
from web.live.telemetry import TelemetryFeed
from web.signals import INDEX

START_NS = 1_700_000_000_250_000_000


def ticks_of(count: int = 1, rate: float = 500.0, start: float = 0.0) -> Record:
    """Return ticks at rest in the origin, the first one `start` s after START_NS."""
    ticks = np.zeros(count, TICK)
    times = np.round(1e9 * (start + np.arange(count) / rate))
    ticks["imu"]["stamp_ns"] = START_NS + times.astype(np.int64)
    ticks["state"]["quaternion_wb"][:, 0] = 1.0
    return ticks


def packets_of(ticks: Record) -> list[bytes]:
    starts = range(0, len(ticks), SAMPLES_A_PACKET)
    return [pack(ticks[k : k + SAMPLES_A_PACKET], k) for k in starts]


class Received:
    """The messages that a web process received of a vehicle; `clock` is that of the computer."""

    def __init__(self, **options: Any) -> None:
        self.clock = Clock(10.0)
        self.log = SignalLog(clock=self.clock, **options)
        self.live = Live(decode, self.clock, self.log.put)
        self.feed = TelemetryFeed(self.live, self.log, self.clock)

    def ticks(self, ticks: Record) -> None:
        for packet in packets_of(ticks):
            self.live.put(TICKS, packet, START_NS)
        self.log.take()

    def put(self, topic: str, message: Any, time: float = 0.0) -> None:
        """Receive a message whose stamp is `time` s after START_NS."""
        self.live.put(topic, encode(message), START_NS + round(1e9 * time))
        self.log.take()

    def newest(self) -> dict[str, float]:
        """Return the newest value of every signal, NaN without one."""
        found = dict.fromkeys(INDEX, math.nan)
        for name in found:
            if count := self.log.formed(name):
                found[name] = float(self.log.values(name, count - 1, count)[0])
        return found

    def times(self) -> list[float]:
        """Return the times of the ticks."""
        log = self.log.log("state")
        return [] if log is None else log.time.tolist()

    def samples(self, name: str) -> list[float]:
        return [float(one) for one in self.log.values(name, 0, self.log.formed(name))]
