"""The measurements of a replay: those of the log, or ones emulated again from the truth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol, TypeVar

import numpy as np

from bearing_sim.emulator import BearingEmulator, BearingParameters
from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from quadlab.replay.errors import Truth
from quadlab.replay.lines import SWEEPS, Run
from quadlab.replay.log import Arrival, Recording
from quadrotor.errors import LogFormatError
from quadrotor.records import Array, Stamps, bearings_sample, pose_sample

T = TypeVar("T")


class Sensor(Protocol[T]):
    """An emulator, which is given poses and returns the measurements that have arrived."""

    @property
    def next_ns(self) -> int | None: ...

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None: ...

    def due(self, now_ns: int) -> list[T]: ...


class MeasurementStore:
    """The measurements of runs; runs with the same noise, seed and beacons share them."""

    def __init__(self, recording: Recording, truth: Truth) -> None:
        self._recording, self._truth = recording, truth
        self._made: dict[str, list[Arrival]] = {}

    def of(self, run: Run) -> list[Arrival]:
        """Return the measurements in the order of arrival; at equal times poses first, as the
        station sends them.
        """
        if run.source == SWEEPS:
            return self._recording.sweeps
        kinds = [self._kind(run, kind) for kind in ("poses", "bearings")]
        return sorted([*kinds[0], *kinds[1]], key=lambda one: one.arrival_ns)

    def _kind(self, run: Run, kind: str) -> list[Arrival]:
        recorded = self._recording.poses if kind == "poses" else self._recording.bearings
        if kind not in run.emulated:
            return recorded  # may be unused: the run's source decides
        p = run.parameters.tracker if kind == "poses" else run.parameters.bearings
        key = f"{kind} {p!r}"
        if key not in self._made:
            if not np.isfinite(self._truth.quaternion_wb).all():
                raise LogFormatError(
                    f"{self._recording.path} has a truth without attitude, and {kind} cannot be "
                    "made of positions alone; --on poses or recorded-bearings takes what it holds"
                )
            samples_ns = self._recording.imu["stamp_ns"]
            if isinstance(p, BearingParameters):
                self._made[key] = emulated_bearings(self._truth, samples_ns, p)
            else:
                self._made[key] = emulated_poses(self._truth, samples_ns, p)
        return self._made[key]


def emulated_bearings(
    truth: Truth, samples_ns: Stamps, parameters: BearingParameters
) -> list[Arrival]:
    """Return frames as `quadlab fly` would have sent them: same seed and truth, same frames."""
    emulator = BearingEmulator(parameters)
    return [
        Arrival(
            arrival_ns,
            bearings_sample(frame.stamp_ns, frame.beacon_ids, frame.bearings_b, frame.sigma),
        )
        for arrival_ns, frame in _arrivals(emulator, truth, samples_ns)
    ]


def emulated_poses(
    truth: Truth, samples_ns: Stamps, parameters: TrackerParameters
) -> list[Arrival]:
    """Return poses as the simulated tracker would have sent them."""
    tracker = SimulatedTracker(parameters)
    return [
        Arrival(arrival_ns, pose_sample(pose.stamp_ns, pose.position_w, pose.quaternion_wb))
        for arrival_ns, pose in _arrivals(tracker, truth, samples_ns)
    ]


def _arrivals(sensor: Sensor[T], truth: Truth, samples_ns: Stamps) -> Iterator[tuple[int, T]]:
    """Yield each measurement with its arrival, which is at an IMU sample, as in a flight."""
    stamps = truth.stamps_ns.tolist()
    end = int(samples_ns[-1])
    for k, stamp_ns in enumerate(stamps):
        if stamp_ns > end:
            return
        sensor.observe(stamp_ns, truth.position_w[k], truth.quaternion_wb[k])
        following = stamps[k + 1] if k + 1 < len(stamps) else end
        while (next_ns := sensor.next_ns) is not None and next_ns < following:
            index = int(np.searchsorted(samples_ns, max(next_ns, stamp_ns)))
            if index == len(samples_ns):
                return
            arrival_ns = int(samples_ns[index])
            for measurement in sensor.due(arrival_ns):
                yield arrival_ns, measurement
