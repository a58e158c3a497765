"""The measurements of a replay: those of the log, or ones emulated again from the truth."""

from __future__ import annotations

import numpy as np

from bearing_sim.emulator import BearingEmulator, BearingMeasurement, BearingParameters
from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from extensions.offline.lines import SWEEPS, Run
from quadlab.recording.errors import Truth
from quadlab.recording.log import Arrival, Recording
from quadrotor.errors import LogFormatError
from quadrotor.records import Record, Stamps, bearings_sample, pose_sample


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
                    f"{self._recording.path} has a truth without attitude, from which {kind} "
                    "cannot be emulated; use --on poses or --on recorded-bearings"
                )
            self._made[key] = emulated(p, self._truth, self._recording.imu["stamp_ns"])
        return self._made[key]


def emulated(
    p: BearingParameters | TrackerParameters, truth: Truth, samples_ns: Stamps
) -> list[Arrival]:
    """Return frames or poses as `quadlab fly` would have sent them: same seed and truth, same
    measurements. Each arrives at an IMU sample, as in a flight.
    """
    sensor: BearingEmulator | SimulatedTracker = (
        SimulatedTracker(p) if isinstance(p, TrackerParameters) else BearingEmulator(p)
    )
    found: list[Arrival] = []
    stamps = truth.stamps_ns.tolist()
    end = int(samples_ns[-1])
    for k, stamp_ns in enumerate(stamps):
        if stamp_ns > end:
            break
        sensor.observe(stamp_ns, truth.position_w[k], truth.quaternion_wb[k])
        following = stamps[k + 1] if k + 1 < len(stamps) else end
        while (next_ns := sensor.next_ns) is not None and next_ns < following:
            index = int(np.searchsorted(samples_ns, max(next_ns, stamp_ns)))
            if index == len(samples_ns):
                return found
            arrival_ns = int(samples_ns[index])
            found += [Arrival(arrival_ns, _record(one)) for one in sensor.due(arrival_ns)]
    return found


def _record(one: BearingMeasurement | PoseMeasurement) -> Record:
    if isinstance(one, PoseMeasurement):
        return pose_sample(*one)
    return bearings_sample(one.stamp_ns, one.beacon_ids, one.bearings_b, one.sigma)
