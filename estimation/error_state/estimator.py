"""The error-state filter behind the protocol of `estimation.estimator`."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled_estimator import CompiledEstimator
from estimation.convergence import Convergence, Deviations
from estimation.error_state import filter as kernels
from estimation.error_state import judgement, start
from estimation.error_state.frame_run import FrameRun
from estimation.error_state.gate import RUN_LEAST
from estimation.error_state.memory import MARKER, new_memory
from estimation.error_state.timeline import apply_one
from estimation.error_state.update import FIT_UPDATES
from estimation.outcome import AHEAD_NS, NORM_TOLERANCE, JudgedReading, Outcome
from estimation.parameters import EstimationParameters, noise_record
from estimation.refusals import refuse_bearings, refuse_pose, refuse_reading, refuse_sweeps
from quadrotor.compiled import direct
from quadrotor.errors import MeasurementError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    NO_ATTITUDE,
    POSE_SAMPLE,
    SWEEPS_SAMPLE,
    Array,
    Record,
    has_attitude,
    pose_sample,
)
from quadrotor.rotations import rotate

ANCHOR_NS = 200_000_000
"""Time in ns without a measurement after which the covariance is propagated all the same."""


class ErrorStateEstimator(CompiledEstimator):
    """Tightly coupled filter: each bearing, or pose, corrects state and biases by their covariance.

    Attributes:
        restarts: a line for each time it was lost and restarted; the reader clears them.
    """

    name = "error_state"
    fewest_beacons = 3

    def __init__(self, parameters: EstimationParameters | None = None) -> None:
        super().__init__(new_memory(), "measurement_ns")
        self.restarts: list[str] = []
        self._on_marker = False
        self._base_ns = self.memory["base_ns"]  # a view, made once
        self._waiting: list[tuple[int, Record]] = []
        self._sweeps: dict[int, Record] = {}
        self._run = FrameRun()
        self._due_ns = 1 << 62
        self._failed: MeasurementError | None = None
        self.configure(parameters or EstimationParameters())
        imu, state, estimate = self.outputs()
        self._predict = direct(kernels.predict, self.memory, imu, self._noise, 0.002, state)
        self._report = direct(kernels.report, self.memory, estimate)

    def configure(self, parameters: EstimationParameters) -> None:
        """Set new noise levels; state and covariance are kept."""
        p = parameters
        self._timeout = p.measurement_timeout
        self._noise = noise_record(p)
        self._marker_b = np.array([self._noise[f"marker_{axis}"][0] for axis in "xyz"])

    @property
    def covariance(self) -> Array:
        """Return the covariance (15, 15) of the error at the newest event (see `memory`)."""
        covariance: Array = self.memory["covariance"][0].copy()
        return covariance

    @property
    def deviations(self) -> Deviations:
        """Return the standard deviations of position, velocity and attitude by its covariance."""
        return judgement.deviations_of(self.memory[0])

    @property
    def inconsistency(self) -> str:
        """Return why its measurements contradict it, with numbers; empty while they do not, or
        while there are too few since a start.
        """
        return judgement.inconsistency_of(self.memory[0]) if self.initialized else ""

    def _judge(self, m: np.void) -> Convergence:
        return judgement.convergence_of(m)

    def reset(self) -> None:
        """Forget everything, biases included."""
        self.memory[:] = new_memory()
        self.initialized = False
        self._waiting.clear()
        self._sweeps.clear()
        self._run.clear()
        self._due_ns = 1 << 62
        self.restarts.clear()

    def initialize(
        self, pose: Record, deviations: Array = start.START, velocity_w: Array | None = None
    ) -> None:
        """Restart at a POSE_SAMPLE (1,), with the present biases.

        With a marker's position, the attitude is the present one or, at the first start, level by
        the accelerometer with the heading of the parameters.

        Args:
            deviations: (15,) of the error, in its order.
            velocity_w: (3,) m/s; at rest without one.

        Raises MeasurementError when the pose is not finite or its quaternion not unit.
        """
        m, position, quaternion = self.memory[0], pose["position_w"][0], pose["quaternion_wb"][0]
        if not has_attitude(quaternion):
            position, quaternion, deviations = start.start_on_marker(
                m, position, self._noise[0], deviations, initialized=self.initialized
            )
        norm2 = float(quaternion @ quaternion)
        if not (np.isfinite(position).all() and abs(norm2 - 1.0) < NORM_TOLERANCE):
            raise refuse_pose(pose)
        stamp_ns = int(pose["stamp_ns"][0])
        start.begin(m, stamp_ns, position, quaternion / math.sqrt(norm2), deviations, velocity_w)
        self.initialized = True
        if m["stamp_ns"] > m["base_ns"]:
            self._anchor()

    def take_heading(self) -> None:
        """Restart at the present position with the heading of the parameters if the filter runs on
        a marker alone: a turn, or minutes of waiting, on the ground cannot be observed.
        """
        m = self.memory[0]
        if self.initialized and self._on_marker:
            marker_w = m["now"][:3] + rotate(m["now"][6:10], self._marker_b)
            self.initialized = False
            self.initialize(pose_sample(int(m["stamp_ns"]), marker_w, NO_ATTITUDE))

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE (1,) that follows the last one by `dt` s; write the STATE (1,).

        Before the first pose only the angular velocity is estimated.
        """
        self._predict(self.memory, imu, self._noise, dt, state)
        now_ns = self._stamp_ns.item()
        if now_ns >= self._due_ns:
            self._apply_waiting(now_ns)
        if self.initialized and now_ns - self._base_ns.item() > ANCHOR_NS:
            self._anchor()

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE (1,), delayed or not; the very first one initializes.

        A pose that cannot be applied is counted in `ignored`. Raises MeasurementError when the pose
        is not finite or its quaternion not unit.
        """
        if not self.initialized:
            self.initialize(pose)
            return
        if not self._take(pose):
            raise self._refused(refuse_pose(pose))
        self._apply(pose)

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        """Apply a BEARINGS_SAMPLE (1,), delayed or not, with any number of beacons.

        Before any pose, the first frame that determines one by itself starts the filter. A frame
        that cannot be applied is counted in `ignored`. Raises MeasurementError when a number is not
        finite, a bearing not unit, or no start pose was found; UndeterminedStartError when a pose
        from elsewhere would help (`initialize`).
        """
        if not self._take(bearings):
            raise self._refused(refuse_bearings(bearings))
        if self.initialized:
            self._apply(bearings)
        else:
            self._start_from(bearings)

    def correct_sweeps(self, sweeps: Record, estimate: Record) -> None:
        """Apply a SWEEPS_SAMPLE (1,), delayed or not: the angles at which one plane met the
        sensors.

        The first planes that together determine a pose start the filter. A sample that cannot be
        applied is counted in `ignored`. Raises MeasurementError when a number is unusable, and
        UndeterminedStartError while there is no pose to start from.
        """
        if not self._take(sweeps):
            raise self._refused(refuse_sweeps(sweeps))
        self._sweeps[int(sweeps["number"][0])] = sweeps[0].copy()
        if self.initialized:
            self._apply(sweeps)
        else:
            self._start_from_sweeps(sweeps)

    def correct_reading(self, reading: Record) -> JudgedReading:
        """Apply a READING_SAMPLE (1,), delayed or not, once something else has started the filter.

        Its number is gated and weighted as a pose's are, but it starts and restarts nothing, and
        does not count as a measurement. Raises MeasurementError when a number is unusable.
        """
        if not self._take(reading):
            raise refuse_reading(reading)
        if not self.initialized:
            return JudgedReading(Outcome.TOO_OLD)
        m = self.memory[0]
        outcome = Outcome(apply_one(m, self._noise[0]))
        if outcome not in (Outcome.APPLIED, Outcome.OUTLIER):
            return JudgedReading(outcome)
        return JudgedReading(outcome, *m["reading"].tolist())

    def report(self, estimate: Record) -> None:
        """Write biases, the last correction and the measurement age into the ESTIMATE (1,)."""
        self._report(self.memory, estimate)

    def warnings(self, rate: float) -> list[str]:
        """Return a warning when no measurements arrive; no gain depends on their rate (Hz)."""
        if math.isfinite(rate) and rate > 0.0:
            return []
        return ["no measurement comes: position and velocity are only predicted"]

    # ------------------------------------------------------------------ parts
    def _take(self, measurement: Record) -> bool:
        """Store it as the new measurement; return False when it is invalid."""
        m = self.memory[0]
        taken = kernels.take(m, measurement)
        if measurement.dtype == POSE_SAMPLE:
            self._on_marker = m["new_kind"] == MARKER
        return taken

    def _apply(self, measurement: Record) -> None:
        """Apply the stored measurement, now or when the IMU has reached its time. Raises
        MeasurementError.
        """
        m = self.memory[0]
        if 0 < int(m["new_ns"] - m["stamp_ns"]) <= AHEAD_NS:
            self._waiting.append((int(m["new_ns"]), measurement.copy()))
            self._due_ns = min(due_ns for due_ns, _ in self._waiting)
        else:
            self._settle(measurement)
        if self._failed is not None:
            failed, self._failed = self._failed, None
            raise failed

    def _apply_waiting(self, now_ns: int) -> None:
        """Apply measurements that were ahead of the IMU and no longer are."""
        ready = [one for due_ns, one in self._waiting if due_ns <= now_ns]
        self._waiting = [item for item in self._waiting if item[0] > now_ns]
        self._due_ns = min((due_ns for due_ns, _ in self._waiting), default=1 << 62)
        for one in ready:
            self._take(one)
            try:
                self._settle(one)
            except MeasurementError as error:  # raised by the next correction, not by a prediction
                self._failed = error

    def _settle(self, measurement: Record) -> None:
        """Apply the stored measurement; when the filter is lost, restart from it.

        Raises MeasurementError when it gives no start.
        """
        m = self.memory[0]
        outcome, confirmed = apply_one(m, self._noise[0]), m["applied"] >= FIT_UPDATES
        tracked = measurement.dtype == POSE_SAMPLE
        if measurement.dtype == BEARINGS_SAMPLE:
            frame = measurement[0]
            all_used = bool(m["used"][: int(frame["count"])].all())
            self._run.compare(frame, outcome, all_used=all_used)
        if outcome != Outcome.OUTLIER and (tracked or outcome != Outcome.APPLIED):
            return
        if measurement.dtype == SWEEPS_SAMPLE:
            agree = judgement.is_contradicted(m)  # the pose that they give says whether
        else:
            agree = m["run_count"] >= RUN_LEAST if tracked else self._run.long_enough
        if not judgement.is_lost(m, confirmed=bool(confirmed), agree=bool(agree)):
            return
        contradiction = judgement.contradiction_of(m, confirmed=bool(confirmed))
        before, innovation = m["now"].copy(), m["innovation"].copy()
        if tracked:
            if not agree:  # they contradict each other, too
                return
            missed_w = judgement.missed_velocity(m)  # the world may have been turned, too
            deviations = start.START.copy()
            deviations[6:9] = np.maximum(start.START[6:9], np.linalg.norm(missed_w))
            self.initialize(measurement, deviations, before[3:6] + missed_w)
        elif measurement.dtype == SWEEPS_SAMPLE:
            self._start_from_sweeps(measurement, before[3:6])
        else:
            self._start_from(measurement)
        m["restarted"], m["consistency"] = 1, judgement.NOT_YET_CONSISTENT
        m["innovation"] = innovation
        m["outcomes"][outcome] -= 1  # it is counted as applied by the start
        self.restarts.append(judgement.restart_line(m, before, contradiction))

    def _anchor(self) -> None:
        """Propagate filter and covariance to the newest sample without a measurement."""
        kernels.take_nothing(self.memory[0])
        apply_one(self.memory[0], self._noise[0])

    def _start_from(self, bearings: Record) -> None:
        """Start at the pose that one frame gives by itself. Raises MeasurementError."""
        frame = bearings[0]
        pose, sigma = start.start_by_bearings(frame), start.START[6:9]
        velocity_w: Array | None = None
        if self._run.long_enough:
            velocity_w, sigma = self._run.velocity()
        self.initialize(*start.start_at(frame, pose, sigma), velocity_w)

    def _start_from_sweeps(self, sweeps: Record, velocity_w: Array | None = None) -> None:
        """Start at the pose that the planes' newest sweeps give. Raises UndeterminedStartError."""
        plane_sigma = float(self._noise["sweep_plane_sigma"][0])
        stamp_ns = int(sweeps["stamp_ns"][0])
        pose = start.start_by_sweeps(self._sweeps.values(), stamp_ns, plane_sigma)
        self.initialize(*start.start_at(sweeps[0], pose), velocity_w)

    def _refused(self, error: MeasurementError) -> MeasurementError:
        self.memory["outcomes"][0, Outcome.INVALID] += 1
        return error
