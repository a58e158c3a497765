"""The error-state filter behind the protocol of `estimation.estimator`."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from estimation.convergence import Convergence, Deviations
from estimation.error_state import filter as kernels
from estimation.error_state.frame_run import FrameRun
from estimation.error_state.gate import RUN_LEAST
from estimation.error_state.memory import ERRORS, MARKER, SAMPLES, new_memory
from estimation.error_state.parameters import noise_record
from estimation.error_state.timeline import apply_one
from estimation.error_state.update import FIT_CONSISTENCY, FIT_UPDATES, LOST_REFUSALS
from estimation.outcome import AHEAD_NS, NORM_TOLERANCE, Outcome
from estimation.parameters import EstimationParameters
from estimation.poses.planar_pose import PlanarPose, planar_pose
from estimation.poses.sweep_pose import sweep_pose
from estimation.refusals import refuse_bearings, refuse_pose, refuse_sweeps
from estimation.sweep_angles import plane_numbers
from quadrotor.errors import DegenerateGeometryError, MeasurementError, UndeterminedStartError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    NO_ATTITUDE,
    POSE_SAMPLE,
    SWEEPS_SAMPLE,
    Record,
    has_attitude,
    pose_sample,
)
from quadrotor.rotations import quaternion_from_euler, rotate

Array = npt.NDArray[np.float64]

ANCHOR_NS = 200_000_000
"""Without a measurement for so long the covariance is brought to the present by itself."""
JUMP_WAIT_NS, DRIFT_WAIT_NS = 500_000_000, 200_000_000
"""LOST_REFUSALS measurements in a row, for so long, mean that the filter is wrong: when they were
suddenly far from it, or when none were used for a while before. A start that fewer than FIT_UPDATES
have confirmed is wrong as soon as RUN_LEAST contradict it together."""
SHORTEST_RUN = 0.1
"""s over which the motion of such poses is taken, at least."""
START = np.repeat([0.05, math.radians(3.0), 0.5, 0.01, 0.1], 3)
"""Deviations at a start: m, rad, m/s (taken to be at rest), rad/s, m/s^2."""
HEADING_SIGMA = math.radians(10.0)
"""Deviation of the heading at which a vehicle on a marker alone is said to stand."""
CALIBRATED = 0.001
"""rad/s, deviation of the bias that a calibrated gyroscope keeps: without an attitude measured
START's would leave the heading open within seconds."""
DETERMINED = 4
"""Bearings to beacons in one plane that leave one pose."""
ONE_PLACE_NS = 60_000_000
"""Sweeps of the planes within it met the vehicle at nearly one place, for a start."""
HOW_TO_START = (
    "bring a fourth beacon in their plane into view, "
    "or run it as the shadow of an estimator on poses"
)
FIT = Deviations(position=0.15, velocity=0.2, attitude=math.radians(3.0))
"""Largest deviations to be flown on."""
REFUSED_MAX = 0.5
"""Largest share of the last measurements refused of a filter that is consistent."""
NOT_YET_CONSISTENT = 2.0 * FIT_CONSISTENCY
"""Mean consistency a filter restarts with: measurements have to bring it down."""


class ErrorStateEstimator:
    """Tightly coupled: each bearing, or pose, corrects state and biases by their covariance.

    Attributes:
        restarts: a line for each time it was lost and started again; who tells them clears them.
    """

    name = "error_state"
    fewest_beacons = 3

    def __init__(self, parameters: EstimationParameters | None = None) -> None:
        self.restarts: list[str] = []
        self._memory = new_memory()
        self._initialized = self._on_marker = False
        self._waiting: list[tuple[int, Record]] = []
        self._sweeps: dict[int, Record] = {}
        self._run = FrameRun()
        self._due_ns = 1 << 62
        self._failed: MeasurementError | None = None
        self._remember_views()
        self.configure(parameters or EstimationParameters())

    def _remember_views(self) -> None:
        # Views made once: looking a field up by name takes longer than the subtraction.
        self._stamp_ns, self._base_ns = self._memory["stamp_ns"], self._memory["base_ns"]
        self._measurement_ns = self._memory["measurement_ns"]

    def configure(self, parameters: EstimationParameters) -> None:
        """Take new noise levels; state and covariance are kept."""
        p = parameters
        self._timeout = p.measurement_timeout
        self._noise = noise_record(p.error_state, p)
        self._marker_b = np.array([self._noise[f"marker_{axis}"][0] for axis in "xyz"])

    @property
    def initialized(self) -> bool:
        """Return whether a first pose was taken or found."""
        return self._initialized

    @property
    def measurement_age(self) -> float:
        """Return seconds from the newest measurement applied to the newest sample; inf before
        both.
        """
        if not self._initialized:
            return math.inf
        age_ns = self._stamp_ns.item() - self._measurement_ns.item()
        return 1e-9 * age_ns if age_ns > 0 else 0.0

    @property
    def stale(self) -> bool:
        """Return whether the newest measurement applied is older than `measurement_timeout`."""
        return self.measurement_age > self._timeout

    @property
    def ignored(self) -> Counter[Outcome]:
        """Return how many measurements since the reset were not applied, by Outcome."""
        counts = self._memory["outcomes"][0].tolist()
        counts[Outcome.APPLIED] = 0
        return +Counter(dict(zip(Outcome, counts, strict=True)))

    @property
    def memory(self) -> Record:
        """Return the filter's memory, shape (1,), for logs and tests."""
        return self._memory

    @property
    def covariance(self) -> Array:
        """Return (15, 15) of the error of `estimation.error_state.memory`, at the newest event."""
        covariance: Array = self._memory["covariance"][0].copy()
        return covariance

    @property
    def deviations(self) -> Deviations:
        """Return the standard deviations of position, velocity and attitude, from the filter's own
        covariance.
        """
        variances = np.diag(self._memory["covariance"][0])
        position, attitude, velocity = np.sqrt(variances[:9].reshape(3, 3).sum(axis=1)).tolist()
        return Deviations(position, velocity, attitude)

    @property
    def convergence(self) -> Convergence:
        """Return the convergence, judged by the measurements applied, their age, covariance and
        normalised innovations.
        """
        if not self._initialized:
            return Convergence(False, "no measurement gave it a start yet")
        if self.stale:
            return Convergence(False, f"last measurement applied {self.measurement_age:.2f} s ago")
        applied = int(self._memory["applied"][0])
        if applied < FIT_UPDATES:
            return Convergence(False, f"{applied} measurements applied, needs {FIT_UPDATES}")
        refused = int(self._memory["refused"][0])
        if refused >= LOST_REFUSALS:
            return Convergence(False, f"the last {refused} measurements did not agree with it")
        consistency = float(self._memory["consistency"][0])
        if not consistency < FIT_CONSISTENCY:
            return Convergence(
                False,
                f"innovations {consistency:.1f} times their expected square, "
                f"allowed {FIT_CONSISTENCY:g}",
            )
        d = self.deviations
        text = (
            f"deviations {d.position:.3f} m, {d.velocity:.3f} m/s, "
            f"{math.degrees(d.attitude):.2f} deg"
        )
        fit = d.position < FIT.position and d.velocity < FIT.velocity and d.attitude < FIT.attitude
        if not fit:
            text += (
                f"; allowed {FIT.position:g} m, {FIT.velocity:g} m/s, "
                f"{math.degrees(FIT.attitude):g} deg"
            )
        return Convergence(fit, text)

    @property
    def inconsistency(self) -> str:
        """Return why its measurements contradict it, with numbers; empty while they do not, and
        from a start to when there are enough of them to judge.
        """
        m = self._memory[0]
        if not self._initialized or m["restarted"]:
            return ""
        if not np.isfinite(m["now"]).all():
            return "its estimate is not a number"
        if m["applied"] + m["refused"] < FIT_UPDATES:
            return ""
        refused, share = int(m["refused"]), float(m["refused_share"])
        if refused >= LOST_REFUSALS:
            return f"the last {refused} measurements did not agree with it"
        if share > REFUSED_MAX:
            return f"{share:.0%} of its measurements refused, allowed {REFUSED_MAX:.0%}"
        consistency = float(m["consistency"])
        if consistency >= FIT_CONSISTENCY:
            return (
                f"innovations {consistency:.1f} times their expected square, "
                f"allowed {FIT_CONSISTENCY:g}"
            )
        return ""

    @property
    def converged(self) -> bool:
        """Return whether the estimate may be used for flight; `convergence` has the reason."""
        return self.convergence.reached

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
        """Start again at a POSE_SAMPLE (1,), with the biases so far. Of a marker's position the
        attitude is the one so far or, at the first start, level by the accelerometer with the
        heading of the parameters.

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
        known = bool(m["initialized"])
        bias, biases_covariance = m["now"][10:].copy(), m["covariance"][9:, 9:].copy()
        x = m["base"]
        x[:3], x[6:10], x[10:] = position, quaternion / math.sqrt(norm2), bias
        x[3:6] = 0.0 if velocity_w is None else velocity_w
        m["covariance"] = np.diag(deviations**2)
        if known:  # what was learnt of the biases stays
            m["covariance"][9:, 9:] = biases_covariance
        stamp_ns = int(pose["stamp_ns"][0])
        m["measurement_ns"] = stamp_ns
        m["base_ns"] = min(stamp_ns, int(m["stamp_ns"])) if m["sample_count"] else stamp_ns
        m["now"] = x
        m["initialized"], m["consistency"], m["applied"], m["refused"] = 1, 1.0, 0, 0
        m["restarted"], m["freedom"], m["innovation"] = 0, 0, 0.0
        m["refused_share"], m["run_count"], m["last_unit"] = 0.0, 0, 0.0
        m["outcomes"][Outcome.APPLIED] += 1
        m["event_count"], m["event_order"][0], m["event_kind"][0] = 1, 0, 0
        m["event_ns"][0] = m["base_ns"]
        m["after_state"][0], m["after_covariance"][0] = x, m["covariance"]
        self._initialized = True
        if m["stamp_ns"] > m["base_ns"]:
            self._anchor()

    def take_heading(self) -> None:
        """Start again where it is with the heading of the parameters if it runs on a marker alone:
        nothing tells of a vehicle turned, or waiting for minutes, on the ground.
        """
        m = self._memory[0]
        if self._initialized and self._on_marker:
            marker_w = m["now"][:3] + rotate(m["now"][6:10], self._marker_b)
            self._initialized = False
            self.initialize(pose_sample(int(m["stamp_ns"]), marker_w, NO_ATTITUDE))

    def _at_rest(self) -> Array:
        """Return the quaternion that the newest specific force and the heading give."""
        newest = int(self._memory["sample_next"][0] - 1) % SAMPLES
        x, y, z = self._memory["sample"][0, newest, 3:]
        level = (math.atan2(y, z), math.atan2(-x, math.hypot(y, z)))
        return quaternion_from_euler(*level, float(self._noise["heading"][0]))

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE (1,) that came `dt` s after the last; write the STATE (1,).

        Before the first pose only the angular velocity is estimated.
        """
        kernels.predict(self._memory, imu, self._noise, dt, state)
        now_ns = self._stamp_ns.item()
        if now_ns >= self._due_ns:
            self._apply_waiting(now_ns)
        if self._initialized and now_ns - self._base_ns.item() > ANCHOR_NS:
            self._anchor()

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE (1,), late or not; the first of all initializes.

        What cannot be applied is counted in `ignored`. Raises MeasurementError when the pose is
        not finite or its quaternion not unit.
        """
        if not self._initialized:
            self.initialize(pose)
            return
        if not self._take(pose):
            raise self._refused(refuse_pose(pose))
        self._apply(pose)

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        """Apply a BEARINGS_SAMPLE (1,), late or not, any number of beacons.

        Before any pose the first frame that determines one by itself starts the filter. What
        cannot be applied is counted in `ignored`. Raises MeasurementError when a number is not
        finite, a bearing not unit, or no pose was found to start from: UndeterminedStartError
        when one from elsewhere would do (`initialize`).
        """
        if not self._take(bearings):
            raise self._refused(refuse_bearings(bearings))
        if self._initialized:
            self._apply(bearings)
        else:
            self._start_from(bearings)

    def correct_sweeps(self, sweeps: Record, estimate: Record) -> None:
        """Apply a SWEEPS_SAMPLE (1,), late or not: the angles at which one plane met the sensors.

        The first planes that determine a pose together start the filter. What cannot be applied is
        counted in `ignored`. Raises MeasurementError when a number is not usable, and
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
        """Return a warning when no measurement comes; no gain depends on their rate (Hz)."""
        if math.isfinite(rate) and rate > 0.0:
            return []
        return ["no measurement comes: position and velocity are only predicted"]

    # ------------------------------------------------------------------ parts
    def _take(self, measurement: Record) -> bool:
        """Make it the new measurement; False when it is none."""
        m, item = self._memory[0], measurement[0]
        if measurement.dtype == POSE_SAMPLE:
            taken = bool(kernels.take_pose(m, item))
            self._on_marker = m["new_kind"] == MARKER
            return taken
        if measurement.dtype == BEARINGS_SAMPLE:
            return bool(kernels.take_bearings(m, item))
        return bool(kernels.take_sweeps(m, item, plane_numbers(item)))

    def _apply(self, measurement: Record) -> None:
        """Apply what was taken, now or when the IMU has come so far. Raises MeasurementError."""
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
        """Apply what was taken; when the filter is lost, start again from it.

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
            # The velocity by which the poses left the prediction, in a world that was turned, too.
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
        m["outcomes"][outcome] -= 1  # counted as used by the start
        apart = float(np.linalg.norm(m["now"][:3] - before[:3]))
        many = f"{count} measurements in {1e-9 * lost_ns:.1f} s"
        self.restarts.append(
            f"error_state restarted, {apart:.2f} m from where it was: "
            f"{many if confirmed else f'the first {RUN_LEAST} measurements'} did not agree with it"
        )

    def _anchor(self) -> None:
        """Bring filter and covariance to the newest sample without a measurement."""
        kernels.take_nothing(self._memory[0])
        apply_one(self._memory[0], self._noise[0])

    def _hold(self, frame: Any, outcome: int) -> None:
        """Hold a frame of which not every bearing was used against the run of such frames."""
        m, count = self._memory[0], int(frame["count"])
        if outcome == Outcome.APPLIED and m["used"][:count].all():
            self._run.clear()
        elif outcome in (Outcome.APPLIED, Outcome.OUTLIER) and count >= DETERMINED:
            try:
                pose = _pose_of(frame)
            except (DegenerateGeometryError, MeasurementError):
                self._run.clear()  # it contradicts itself
            else:
                self._run.add(int(frame["stamp_ns"]), pose)

    def _start_from(self, bearings: Record) -> None:
        """Start at the pose one frame gives by itself. Raises MeasurementError."""
        frame = bearings[0]
        count = int(frame["count"])
        if count < DETERMINED:
            why = "up to four poses fit them" if count == 3 else "they leave the pose open"
            raise UndeterminedStartError(
                f"error_state cannot start on {count} bearings: {why}; {HOW_TO_START}"
            )
        try:
            pose = _pose_of(frame)
        except DegenerateGeometryError as error:
            raise UndeterminedStartError(
                f"error_state cannot start on these bearings: {error}; {HOW_TO_START}"
            ) from error
        self._start_at(frame, pose, *(self._run.velocity() if self._run.long_enough else ()))

    def _start_from_sweeps(self, sweeps: Record, velocity_w: Array | None = None) -> None:
        """Start at the pose that the newest sweeps of the planes give. Raises
        UndeterminedStartError.
        """
        oldest_ns = int(sweeps["stamp_ns"][0]) - ONE_PLACE_NS
        frames = [one for one in self._sweeps.values() if one["stamp_ns"] > oldest_ns]
        try:
            self._start_at(sweeps[0], sweep_pose(frames), velocity_w)
        except DegenerateGeometryError as error:
            raise UndeterminedStartError(
                f"error_state cannot start on these sweeps: {error}"
            ) from error

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


def _pose_of(frame: Any) -> PlanarPose:
    """Return the pose that a BEARINGS_SAMPLE item gives. Raises MeasurementError,
    DegenerateGeometryError.
    """
    count = int(frame["count"])
    return planar_pose(frame["beacon_w"][:count], frame["bearing_b"][:count], frame["sigma"])


assert len(START) == ERRORS
