"""One run of an estimator over a recorded flight: the estimation part of the vehicle's tick."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import parse_layout
from console.evaluation.findings import HELD, NEARLY, stretches
from estimation import registry
from estimation.error_state.estimator import ErrorStateEstimator
from estimation.estimator import Estimator, TakesHeading
from extensions.offline.lines import BELIEVED_LAYOUT, Run
from quadlab.recording.errors import ALL, Consistency, Posterior, of_innovations
from quadlab.recording.log import Arrival, Change, Recording
from quadrotor.errors import MeasurementError, ParameterError, UndeterminedStartError
from quadrotor.parameters import ParameterStore
from quadrotor.records import (
    ESTIMATE,
    POSE_SAMPLE,
    STATE,
    SWEEPS_SAMPLE,
    Array,
    Record,
    Stamps,
    new_state,
    pose_sample,
)
from vehicle.flight.tick_record import LONGEST_GAP, NOMINAL_STEP

SENSORS = ("gyroscope", "accelerometer")
STATE_AGE_NS = 50_000_000
"""Age, in ns, above which a recorded state cannot start the estimator."""
_BYTES = f"V{STATE.itemsize}"


@dataclass
class Replayed:
    """The result of a replayed run; the lists have one item for each measurement."""

    states: Record  # (N,) STATE, at the samples
    processor: float = 0.0  # s
    started_ns: int | None = None  # sample at which a measurement started it
    complaint: str = ""  # the last measurement that could not be used
    taken_ns: list[int] = field(default_factory=list)
    rejected: list[bool] = field(default_factory=list)
    nis: list[float] = field(default_factory=list)  # per component; NaN: none
    freedom: list[int] = field(default_factory=list)  # components of the measurement
    deviations: list[tuple[float, float, float]] = field(default_factory=list)  # m, m/s, rad
    bounds: dict[str, list[float]] = field(  # largest bias over its bound, by its parameter
        default_factory=lambda: {f"estimation.{one}_bias_limit": [] for one in SENSORS}
    )
    posteriors: list[Posterior] = field(default_factory=list)  # of measurements used

    def within(self, start_ns: int, end_ns: int) -> tuple[int, float | None, Consistency | None]:
        """Return the number of measurements, the share rejected and the NIS in a window."""
        taken = np.array(self.taken_ns, np.int64)
        inside = (taken >= start_ns) & (taken <= end_ns)
        count = int(inside.sum())
        nis = of_innovations(np.array(self.nis)[inside], np.array(self.freedom, int)[inside])
        return count, float(np.mean(np.array(self.rejected)[inside])) if count else None, nis

    def held(self) -> dict[str, float]:
        """Return for how long (s) biases were at their bounds for more than a second at a time."""
        seconds = 1e-9 * np.array(self.taken_ns, np.float64)
        found = {}
        for name, used in self.bounds.items():
            spans = stretches(seconds, np.array(used) >= NEARLY)
            found[name] = sum(end - start for start, end in spans if end - start > HELD)
        return {name: lasted for name, lasted in found.items() if lasted}

    def posteriors_within(self, start_ns: int, end_ns: int) -> list[Posterior]:
        """Return the posteriors within a window."""
        return [one for one in self.posteriors if start_ns <= one.stamp_ns <= end_ns]

    def position_deviations(self) -> tuple[Stamps, Array]:
        """Return stamps and standard deviation of position (m) where the estimator stated one."""
        stamps = np.array(self.taken_ns, np.int64)
        position = np.array([one[0] for one in self.deviations])
        known = np.isfinite(position)
        return stamps[known], position[known]


def replay(recording: Recording, run: Run, arrivals: list[Arrival]) -> Replayed:
    """Feed samples and measurements to the estimator in the order in which the vehicle had them.

    Args:
        arrivals: measurements in the order of their arrival.
    """
    registry.prepare(run.estimator, bearings=True)
    return Vehicle(recording, run).fly(arrivals)


class Vehicle:
    """The part of a vehicle that `vehicle.estimators.navigation` runs with its active estimator.

    Parameters that changed in flight change here too, unless the run fixes them.
    """

    def __init__(self, recording: Recording, run: Run) -> None:
        self._recording = recording
        self._parameters = run.parameters.model_copy(deep=True)
        self._store = ParameterStore(self._parameters)
        self._changes = [
            change
            for change in recording.changes
            if change.name.startswith(("estimation.", BELIEVED_LAYOUT))
            and change.name not in run.fixed
        ]
        self._estimator: Estimator = registry.create(run.estimator, self._parameters.estimation)
        self._estimate = np.zeros(1, ESTIMATE)
        self._refused = 0
        self._last_pose_ns = -(1 << 62)
        self._out = Replayed(np.zeros(len(recording.imu), STATE))
        self._begin_ns = run.begin_ns
        self._configure()

    def fly(self, arrivals: list[Arrival]) -> Replayed:
        imu, out, estimator = self._recording.imu, self._out, self._estimator
        state, states = new_state(), out.states.view(_BYTES)
        state_bytes = state.view(_BYTES)
        resets, changes = self._recording.resets, self._changes
        armed = self._recording.armed
        next_arrival = next_change = 0
        last_ns = 0
        began = time.process_time()
        for k, now_ns in enumerate(imu["stamp_ns"].tolist()):
            dt = (now_ns - last_ns) * 1e-9 if last_ns else NOMINAL_STEP
            if dt > 0.0:
                last_ns = now_ns
                while next_change < len(changes) and changes[next_change].stamp_ns < now_ns:
                    self._change(changes[next_change])
                    next_change += 1
                begins = self._begin_ns is not None and now_ns > self._begin_ns
                if now_ns in resets or begins:
                    estimator.reset()
                    self._refused, out.started_ns = 0, None
                    self._begin_ns = None if begins else self._begin_ns
                estimator.predict(imu[k : k + 1], min(dt, LONGEST_GAP), state)
                while next_arrival < len(arrivals) and arrivals[next_arrival].arrival_ns < now_ns:
                    self._take(arrivals[next_arrival].measurement, now_ns)
                    next_arrival += 1
                estimator.report(self._estimate)
                if now_ns in armed and isinstance(estimator, TakesHeading):
                    estimator.take_heading()
            states[k] = state_bytes[0]
        out.processor = time.process_time() - began
        return out

    def _change(self, change: Change) -> None:
        try:
            self._store.preset({change.name: change.value})
        except ParameterError:
            return  # of another version
        self._configure()

    def _configure(self) -> None:
        p = self._parameters
        self._estimator.configure(p.estimation)
        self._source = p.estimation.source
        self._timeout_ns = round(1e9 * p.estimation.measurement_timeout)
        self._beacons = KnownBeacons(parse_layout(p.beacons.layout))

    def _take(self, measurement: Record, now_ns: int) -> None:
        estimator, raised = self._estimator, False
        applied = _number(estimator, "applied")
        try:
            if measurement.dtype == SWEEPS_SAMPLE:
                assert isinstance(estimator, ErrorStateEstimator)
                estimator.correct_sweeps(measurement, self._estimate)
            elif measurement.dtype == POSE_SAMPLE:
                if self._source == "bearings":
                    return
                self._last_pose_ns = now_ns
                tracked = self._parameters.estimation.tracker.measured(measurement)
                estimator.correct(tracked, self._estimate)
            else:
                if self._source == "poses" or not self._wants_bearings(now_ns):
                    return
                frame = self._beacons.with_positions(measurement)
                if not frame["count"][0]:
                    return
                estimator.correct_bearings(frame, self._estimate)
        except UndeterminedStartError as error:
            self._out.complaint, raised = str(error), True
            self._start_as_flown(now_ns)
        except MeasurementError as error:
            self._out.complaint, raised = str(error), True
        self._note(now_ns, raised, _number(estimator, "applied") > applied)

    def _start_as_flown(self, now_ns: int) -> None:
        """Start at the pose that was flown on, as the vehicle starts an estimator in parallel with
        the one in use.
        """
        stamps = self._recording.state_ns
        k = int(np.searchsorted(stamps, now_ns, side="right")) - 1
        if k < 0 or now_ns - stamps[k] > STATE_AGE_NS:
            return
        flown = self._recording.state[k]
        if not np.isfinite(flown["quaternion_wb"]).all():
            return  # an imported flight without attitude
        self._estimator.initialize(pose_sample(now_ns, flown["position_w"], flown["quaternion_wb"]))

    def _note(self, now_ns: int, raised: bool, applied: bool) -> None:
        out, estimator = self._out, self._estimator
        refused = sum(getattr(estimator, "ignored", {}).values())
        freedom = _number(estimator, "freedom")
        deviations = estimator.deviations if estimator.initialized else None
        out.taken_ns.append(now_ns)
        out.rejected.append(raised or refused > self._refused)
        used = applied and freedom > 0
        out.nis.append(_number(estimator, "nis") / freedom if used else math.nan)
        out.freedom.append(int(freedom) if used else 0)
        if used and isinstance(estimator, ErrorStateEstimator):
            out.posteriors.append(_posterior(estimator))
        out.deviations.append(
            (deviations.position, deviations.velocity, deviations.attitude)
            if deviations is not None
            else (math.nan, math.nan, math.nan)
        )
        self._refused = refused
        self._note_bounds()
        self._note_start(now_ns)

    def _note_bounds(self) -> None:
        self._estimator.report(self._estimate)
        limits = self._parameters.estimation
        for name, used in self._out.bounds.items():
            limit = float(getattr(limits, name.rpartition(".")[2]))
            bias = self._estimate[name.removeprefix("estimation.").replace("_limit", "_b")]
            used.append(float(np.abs(bias).max()) / limit if limit > 0.0 else 0.0)

    def _note_start(self, now_ns: int) -> None:
        if self._out.started_ns is None and self._estimator.initialized:
            self._out.started_ns = now_ns

    def _wants_bearings(self, now_ns: int) -> bool:
        """Return whether bearings are to be used: estimators with fixed gains weigh them like
        poses, so only in the absence of poses.
        """
        if self._source == "bearings" or self._estimator.deviations is not None:
            return True
        return now_ns - self._last_pose_ns > self._timeout_ns


def _posterior(estimator: ErrorStateEstimator) -> Posterior:
    """Return the posterior after the estimator's newest event."""
    stamp_ns, x = estimator.memory["base_ns"][0], estimator.memory["base"][0].copy()
    return Posterior(int(stamp_ns), x[:3], x[6:10], x[3:6], estimator.covariance[:ALL, :ALL])


def _number(estimator: Estimator, name: str) -> float:
    """Return a number of an estimator's memory; 0 if the estimator does not have it."""
    memory = getattr(estimator, "memory", None)
    names = getattr(getattr(memory, "dtype", None), "names", None) or ()
    return float(memory[name][0]) if memory is not None and name in names else 0.0
