"""Packets of telemetry: every sample to the recorder, the newest to everyone who listens."""

from __future__ import annotations

from collections.abc import Callable

from console.checks.observed import Observed
from console.comparison.feed import ComparisonFeed
from console.experiment_running.runner import ExperimentRunner
from console.link.monitor import LinkMonitor
from console.link.outbox import Outbox
from console.link.telemetry_topics import expanded, messages_of
from console.runs.recorder import Recorder
from vehicle_link.clock import time_ns
from vehicle_link.telemetry import unpack
from vehicle_link.transport.node import Received


class TelemetryIn:
    """The receiver of telemetry, used by one thread. Args: the station's parts that take it;
    `heard` gets its newest stamp.
    """

    def __init__(
        self,
        vehicle: str,
        link: LinkMonitor,
        outbox: Outbox,
        recorder: Recorder,
        comparison: ComparisonFeed,
        observed: Observed,
        experiments: ExperimentRunner,
        heard: Callable[[int], None],
    ) -> None:
        self._vehicle = vehicle
        self._link, self._outbox, self._recorder = link, outbox, recorder
        self._comparison, self._observed = comparison, observed
        self._experiments, self._newest = experiments, heard

    def received(self, received: Received) -> None:
        """Take a packet of telemetry. Raises LinkError for what is none."""
        sequence, ticks = unpack(received.payload)
        stamp_ns = int(ticks["imu"]["stamp_ns"][-1])
        shown = self._link.telemetry(sequence, stamp_ns, received.received_ns, time_ns())
        self._comparison.telemetry(received.payload)
        self._experiments.readings.telemetry(sequence, ticks)
        if shown:
            self._observed.telemetry(ticks[-1])
            self._experiments.feed.telemetry(stamp_ns, ticks["state"]["position_w"][-1])
        payloads: dict[str, list[bytes]] = {}
        if self._recorder.run_id:
            payloads = expanded(ticks, self._vehicle)
            messages = messages_of(payloads, ticks, self._vehicle, received.received_ns)
            self._recorder.put_all(messages)
        elif shown:
            payloads = expanded(ticks[-1:], self._vehicle, self._outbox.heard)
        if shown:
            for name in self._outbox.heard & payloads.keys():
                self._outbox.put(name, payloads[name][-1], stamp_ns)
        self._newest(stamp_ns)
