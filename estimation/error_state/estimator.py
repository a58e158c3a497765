"""The error-state filter behind the protocol of `estimation.estimator`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from estimation.compiled_estimator import CompiledEstimator
from estimation.convergence import Convergence, Deviations
from estimation.error_state import filter as kernels
from estimation.error_state.frame_run import FrameRun
from estimation.error_state.gate import RUN_LEAST
from estimation.error_state.judgement import convergence_of, deviations_of, inconsistency_of
from estimation.error_state.memory import MARKER, SAMPLES, new_memory
from estimation.error_state.start import (
    DETERMINED,
    START,
    begin,
    pose_of_bearings,
    start_by_bearings,
    start_by_sweeps,
)
from estimation.error_state.timeline import apply_one
from estimation.error_state.update import FIT_CONSISTENCY, FIT_UPDATES, LOST_REFUSALS
from estimation.outcome import AHEAD_NS, NORM_TOLERANCE, Outcome
from estimation.parameters import EstimationParameters, noise_record
from estimation.refusals import refuse_bearings, refuse_pose, refuse_sweeps
from estimation.sweep_angles import plane_numbers
from quadrotor.errors import DegenerateGeometryError, MeasurementError
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
from quadrotor.rotations import quaternion_from_euler, rotate

ANCHOR_NS = 200_000_000
"""Time in ns without a measurement after which the covariance is propagated to the
present anyway."""
JUMP_WAIT_NS, DRIFT_WAIT_NS = 500_000_000, 200_000_000
"""Times in ns for which LOST_REFUSALS measurements in a row must be refused until the filter counts
as wrong: when they suddenly jumped away from it, and when none had been used for a while before. A
start that fewer than FIT_UPDATES have confirmed is wrong as soon as RUN_LEAST contradict it
together."""
SHORTEST_RUN = 0.1
"""Shortest time, in s, over which the motion of such poses is computed."""
HEADING_SIGMA = math.radians(10.0)
"""Assumed deviation of the heading, in rad, of a vehicle on a marker alone."""
CALIBRATED = 0.001
"""Deviation, in rad/s, of the bias of a calibrated gyroscope: without measured attitudes, START's
would leave the heading open within seconds."""
ONE_PLACE_NS = 60_000_000
"""Time in ns; sweeps of the planes within it met the vehicle at nearly one place, for a start."""
NOT_YET_CONSISTENT = 2.0 * FIT_CONSISTENCY
"""Mean consistency with which a filter restarts: measurements have to reduce it."""


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
        self._base_ns = self._memory["base_ns"]  # a view, made once
        self._waiting: list[tuple[int, Record]] = []
        self._sweeps: dict[int, Record] = {}
        self._run = FrameRun()
        self._due_ns = 1 << 62
        self._failed: MeasurementError | None = None
        self.configure(parameters or EstimationParameters())

    def configure(self, parameters: EstimationParameters) -> None:
        """Set new noise levels; state and covariance are kept."""
        p = parameters
        self._timeout = p.measurement_timeout
        self._noise = noise_record(p)
        self._marker_b = np.array([self._noise[f"marker_{axis}"][0] for axis in "xyz"])

    @property
    def covariance(self) -> Array:
        """Return the covariance (15, 15) of the error of `estimation.error_state.memory`, at the
        newest event.
        """
        covariance: Array = self._memory["covariance"][0].copy()
        return covariance

    @property
    def deviations(self) -> Deviations:
        """Return the standard deviations of position, velocity and attitude, from the filter's own
        covariance.
        """
        return deviations_of(self._memory[0])

    @property
    def inconsistency(self) -> str:
        """Return why its measurements contradict it, with numbers; empty while they do not, or
        while there are too few since a start.
        """
        return inconsistency_of(self._memory[0]) if self._initialized else ""

    def _judge(self, m: Any) -> Convergence:
        return convergence_of(m)

    def reset(self) -> None:
        """Forget everything, biases included."""
        self._memory[:] = new_memory()
        self._initialized = False
        self._waiting.clear()
        self._sweeps.clear()
        self._run.clear()
        self._due_ns = 1 << 62
        self.restarts.clear()

    def initialize(
        self, pose: Record, deviations: Array = START, velocity_w: Array | None = None
    ) -> None:
        """Restart at a POSE_SAMPLE (1,), with the present biases.

        With a marker's position, the attitude is the present one or, at the first start, level by
        the accelerometer with the heading of the parameters.

        Args:
            deviations: (15,) of the error, in its order.
            velocity_w: (3,) m/s; at rest without one.

        Raises MeasurementError when the pose is not finite or its quaternion not unit.
        """
        m, position, quaternion = self._memory[0], pose["position_w"][0], pose["quaternion_wb"][0]
        if not has_attitude(quaternion):
            quaternion = m["now"][6:10].copy() if self._initialized else self._at_rest()
            position = position - rotate(quaternion, self._marker_b)
            heading = math.sqrt(m["covariance"][5, 5]) if self._initialized else 0.0
            deviations = deviations.copy()
            deviations[5], deviations[9:12] = max(heading, HEADING_SIGMA), CALIBRATED
        norm2 = float(quaternion @ quaternion)
        if not (np.isfinite(position).all() and abs(norm2 - 1.0) < NORM_TOLERANCE):
            raise refuse_pose(pose)
        stamp_ns = int(pose["stamp_ns"][0])
        begin(m, stamp_ns, position, quaternion / math.sqrt(norm2), deviations, velocity_w)
        self._initialized = True
        if m["stamp_ns"] > m["base_ns"]:
            self._anchor()

    def take_heading(self) -> None:
        """Restart at the present position with the heading of the parameters if the filter runs on
        a marker alone: a turn, or minutes of waiting, on the ground cannot be observed.
        """
        m = self._memory[0]
        if self._initialized and self._on_marker:
            marker_w = m["now"][:3] + rotate(m["now"][6:10], self._marker_b)
            self._initialized = False
            self.initialize(pose_sample(int(m["stamp_ns"]), marker_w, NO_ATTITUDE))

    def _at_rest(self) -> Array:
        """Return the quaternion from the newest specific force and the heading parameter."""
        newest = int(self._memory["sample_next"][0] - 1) % SAMPLES
        x, y, z = self._memory["sample"][0, newest, 3:]
        level = (math.atan2(y, z), math.atan2(-x, math.hypot(y, z)))
        return quaternion_from_euler(*level, float(self._noise["heading"][0]))

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE (1,) that follows the last one by `dt` s; write the STATE (1,).

        Before the first pose only the angular velocity is estimated.
        """
        kernels.predict(self._memory, imu, self._noise, dt, state)
        now_ns = self._stamp_ns.item()
        if now_ns >= self._due_ns:
            self._apply_waiting(now_ns)
        if self._initialized and now_ns - self._base_ns.item() > ANCHOR_NS:
            self._anchor()

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE (1,), delayed or not; the very first one initializes.

        A pose that cannot be applied is counted in `ignored`. Raises MeasurementError when the pose
        is not finite or its quaternion not unit.
        """
        if not self._initialized:
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
        if self._initialized:
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
        if self._initialized:
            self._apply(sweeps)
        else:
            self._start_from_sweeps(sweeps)

    def report(self, estimate: Record) -> None:
        """Write biases, the last correction and the measurement age into the ESTIMATE (1,)."""
        kernels.report(self._memory, estimate)

    def warnings(self, rate: float) -> list[str]:
        """Return a warning when no measurements arrive; no gain depends on their rate (Hz)."""
        if math.isfinite(rate) and rate > 0.0:
            return []
        return ["no measurement comes: position and velocity are only predicted"]

    # ------------------------------------------------------------------ parts
    def _take(self, measurement: Record) -> bool:
        """Store it as the new measurement; return False when it is invalid."""
        m, item = self._memory[0], measurement[0]
        if measurement.dtype == POSE_SAMPLE:
            taken = bool(kernels.take_pose(m, item))
            self._on_marker = m["new_kind"] == MARKER
            return taken
        if measurement.dtype == BEARINGS_SAMPLE:
            return bool(kernels.take_bearings(m, item))
        return bool(kernels.take_sweeps(m, item, plane_numbers(item)))

    def _apply(self, measurement: Record) -> None:
        """Apply the stored measurement, now or when the IMU has reached its time. Raises
        MeasurementError.
        """
        m = self._memory[0]
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
        m = self._memory[0]
        outcome, confirmed = apply_one(m, self._noise[0]), m["applied"] >= FIT_UPDATES
        tracked = measurement.dtype == POSE_SAMPLE
        if measurement.dtype == BEARINGS_SAMPLE:
            self._hold(measurement[0], outcome)
        if outcome != Outcome.OUTLIER and (tracked or outcome != Outcome.APPLIED):
            return
        agree = m["run_count"] >= RUN_LEAST if tracked else self._run.long_enough
        lost_ns = int(m["stamp_ns"] - m["refused_ns"])
        waited = lost_ns > (JUMP_WAIT_NS if m["at_once"] else DRIFT_WAIT_NS)
        if (confirmed or not agree) and (m["refused"] < LOST_REFUSALS or not waited):
            return
        count, before, innovation = int(m["refused"]), m["now"].copy(), m["innovation"].copy()
        if tracked:
            if not agree:  # they contradict each other, too
                return
            # The velocity at which the poses left the prediction; the world may have been turned,
            # too.
            lasted = max(1e-9 * float(m["run_ns"] - m["run_start_ns"]), SHORTEST_RUN)
            missed_w = (m["run_last"] - m["run_first"])[:3] / lasted
            deviations = START.copy()
            deviations[6:9] = np.maximum(START[6:9], np.linalg.norm(missed_w))
            self.initialize(measurement, deviations, before[3:6] + missed_w)
        elif measurement.dtype == SWEEPS_SAMPLE:
            self._start_from_sweeps(measurement, before[3:6])
        else:
            self._start_from(measurement)
        m["restarted"], m["consistency"] = 1, NOT_YET_CONSISTENT
        m["innovation"] = innovation
        m["outcomes"][outcome] -= 1  # it is counted as applied by the start
        apart = float(np.linalg.norm(m["now"][:3] - before[:3]))
        many = f"{count} measurements in {1e-9 * lost_ns:.1f} s"
        self.restarts.append(
            f"error_state restarted, {apart:.2f} m from where it was: "
            f"{many if confirmed else f'the first {RUN_LEAST} measurements'} did not agree with it"
        )

    def _anchor(self) -> None:
        """Propagate filter and covariance to the newest sample without a measurement."""
        kernels.take_nothing(self._memory[0])
        apply_one(self._memory[0], self._noise[0])

    def _hold(self, frame: Any, outcome: int) -> None:
        """Compare a frame of which not every bearing was used with the run of such frames."""
        m, count = self._memory[0], int(frame["count"])
        if outcome == Outcome.APPLIED and m["used"][:count].all():
            self._run.clear()
        elif outcome in (Outcome.APPLIED, Outcome.OUTLIER) and count >= DETERMINED:
            try:
                pose = pose_of_bearings(frame)
            except (DegenerateGeometryError, MeasurementError):
                self._run.clear()  # it contradicts itself
            else:
                self._run.add(int(frame["stamp_ns"]), pose)

    def _start_from(self, bearings: Record) -> None:
        """Start at the pose that one frame gives by itself. Raises MeasurementError."""
        frame = bearings[0]
        pose = start_by_bearings(frame)
        self._start_at(frame, pose, *(self._run.velocity() if self._run.long_enough else ()))

    def _start_from_sweeps(self, sweeps: Record, velocity_w: Array | None = None) -> None:
        """Start at the pose that the planes' newest sweeps give. Raises UndeterminedStartError."""
        oldest_ns = int(sweeps["stamp_ns"][0]) - ONE_PLACE_NS
        frames = [one for one in self._sweeps.values() if one["stamp_ns"] > oldest_ns]
        self._start_at(sweeps[0], start_by_sweeps(frames), velocity_w)

    def _start_at(
        self, frame: Record, pose: Any, velocity_w: Array | None = None, sigma: Array = START[6:9]
    ) -> None:
        sample = np.zeros(1, POSE_SAMPLE)
        sample[0] = frame["stamp_ns"], pose.position_w, pose.quaternion_wb
        deviations = START.copy()
        deviations[:6] = np.maximum(np.sqrt(np.diag(pose.covariance)), deviations[:6])
        deviations[6:9] = np.maximum(sigma, deviations[6:9])
        self.initialize(sample, deviations, velocity_w)

    def _refused(self, error: MeasurementError) -> MeasurementError:
        self._memory["outcomes"][0, Outcome.INVALID] += 1
        return error
