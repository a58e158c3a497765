"""The complementary filter of Sec. 6.1 behind the protocol of `estimation.estimator`."""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled_estimator import CompiledEstimator
from estimation.complementary_filter import correct, correct_one, predict, predict_one, report
from estimation.convergence import Convergence, Deviations, ratio
from estimation.history import recall
from estimation.memory import START_ATTITUDE, START_POSITION, new_memory
from estimation.outcome import NORM_TOLERANCE, Agreement, Outcome
from estimation.parameters import EstimationParameters, estimation_record
from estimation.poses.planar_pose import planar_pose
from estimation.poses.position_at_attitude import position_at_attitude
from estimation.refusals import refuse_bearings, refuse_pose
from estimation.stability import gain_warnings
from quadrotor.compiled import direct
from quadrotor.errors import DegenerateGeometryError, MeasurementError
from quadrotor.records import MAX_BEACONS, POSE_SAMPLE, Record, has_attitude

__all__ = ["ComplementaryEstimator", "correct", "correct_one", "predict", "predict_one", "report"]

SETTLED_AFTER = 3.0
"""Time constants of the slower pole after which the filter has forgotten its start."""
FIT_POSITION, FIT_ATTITUDE = 0.5, math.radians(15.0)
"""Largest root mean square of the innovations (m, rad) with which the estimate may be flown on."""


class ComplementaryEstimator(CompiledEstimator):
    """The `Estimator` of the paper, with bias states and late measurements."""

    name = "complementary"

    def __init__(self, parameters: EstimationParameters | None = None) -> None:
        super().__init__(new_memory(), "pose_stamp_ns")
        self._outcome = np.zeros(1, np.int64)
        self._frame_pose = np.zeros(1, POSE_SAMPLE)
        self.configure(parameters or EstimationParameters())
        m, gains, (imu, state, estimate) = self.memory, self._gains, self.outputs()
        self._predict = direct(predict, m, imu, gains, 0.002, state)
        self._apply = direct(correct, m, self._frame_pose, gains, estimate, self._outcome)
        self._report = direct(report, m, estimate)

    def configure(self, parameters: EstimationParameters) -> None:
        """Set new gains; state and biases are kept."""
        self._parameters = parameters.model_copy()
        self._timeout = parameters.measurement_timeout
        self._gains = estimation_record(parameters)
        self._frame_gains = self._gains.copy()

    @property
    def deviations(self) -> Deviations | None:
        """Return None: a filter of fixed gains has no covariance."""
        return None

    def _judge(self, m: np.void) -> Convergence:
        """Return the convergence from the time since the start, in time constants, and the size of
        the innovations.
        """
        p = self._parameters
        if m["agreement"] not in (Agreement.USED, Agreement.MOVED):
            return Convergence(False, "the newest pose is too far from its prediction")
        slowest = min(p.position_bandwidth, p.attitude_bandwidth)
        needed, run = SETTLED_AFTER / slowest, 1e-9 * float(m["stamp_ns"] - m["started_ns"])
        position, attitude = math.sqrt(m["position_spread"]), math.sqrt(m["attitude_spread"])
        share = min(
            ratio(FIT_POSITION, position),
            ratio(FIT_ATTITUDE, attitude),
            max(0.0, run / needed),
            1.0,
        )
        if run < needed:
            late = f"started {run:.1f} s ago, needs {needed:.1f} s at {slowest:g} rad/s"
            return Convergence(False, late, share)
        text = f"innovations {position:.3f} m, {math.degrees(attitude):.2f}° rms"
        fit = position < FIT_POSITION and attitude < FIT_ATTITUDE
        if not fit:
            text += f"; allowed {FIT_POSITION:g} m, {math.degrees(FIT_ATTITUDE):.0f}°"
        return Convergence(fit, text, share)

    def reset(self) -> None:
        """Forget everything, biases included."""
        self.memory[:] = new_memory()
        self.initialized = False

    def initialize(self, pose: Record) -> None:
        """Restart at a POSE_SAMPLE (1,), at rest, with the present biases.

        Raises MeasurementError when the pose is not finite or its quaternion not unit.
        """
        m, position, quaternion = self.memory[0], pose["position_w"][0], pose["quaternion_wb"][0]
        norm2 = float(quaternion @ quaternion)
        if not (np.isfinite(position).all() and abs(norm2 - 1.0) < NORM_TOLERANCE):
            raise refuse_pose(pose)
        m["pose"][:3], m["pose"][3:] = position, quaternion / math.sqrt(norm2)
        m["velocity_w"] = 0.0
        m["pose_stamp_ns"] = m["started_ns"] = pose["stamp_ns"][0]
        m["newest_ns"] = pose["stamp_ns"][0]
        m["position_spread"] = m["attitude_spread"] = 0.0
        m["position_scale"], m["attitude_scale"] = START_POSITION**2, START_ATTITUDE**2
        m["distance"] = m["last_turn"] = 0.0
        m["last_offset_w"] = 0.0
        m["run_count"], m["agreement"] = 0, Agreement.USED
        m["ring_count"] = 0  # the next prediction starts the history
        m["initialized"] = 1
        m["outcomes"][Outcome.APPLIED] += 1
        self.initialized = True

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE (1,) that follows the last one by `dt` s; write the STATE (1,).

        Before the first pose only the angular velocity is estimated.
        """
        self._predict(self.memory, imu, self._gains, dt, state)

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE (1,); write its innovations into the ESTIMATE (1,).

        The very first pose initializes. A pose that is beyond the gate, not newer than the last,
        older than the history or ahead of the IMU is counted in `ignored`. Raises MeasurementError
        when it is not finite or its quaternion not unit.
        """
        if not has_attitude(pose["quaternion_wb"]):
            raise MeasurementError(
                "complementary cannot use positions without attitude; track a rigid body, or set "
                "estimation.estimator = error_state for a single marker"
            )
        if not self.initialized:
            self.initialize(pose)
            return
        self._correct(pose, self._gains, estimate)

    def _correct(self, pose: Record, gains: Record, estimate: Record) -> None:
        self._apply(self.memory, pose, gains, estimate, self._outcome)
        if self._outcome.item() == Outcome.INVALID:
            raise refuse_pose(pose)

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        """Apply a BEARINGS_SAMPLE (1,) through the pose that the frame gives.

        The pose is searched from the estimate at the frame's stamp; its position is then solved
        again at the filter's attitude, which is far better than the frame's own. Raises
        MeasurementError when the frame is malformed or gives no pose, DegenerateGeometryError when
        its beacons, fewer than four or not in a plane, determine none.
        """
        frame = bearings[0]
        count, stamp_ns = int(frame["count"]), int(frame["stamp_ns"])
        if not 1 <= count <= MAX_BEACONS:
            raise refuse_bearings(bearings)
        beacons, seen = frame["beacon_w"][:count], frame["bearing_b"][:count]
        start = None
        if self.initialized and recall(self.memory[0], stamp_ns) > 0:
            past = self.memory["past"][0].copy()
            start = (past[:3], past[3:])
        try:
            pose = planar_pose(beacons, seen, float(frame["sigma"]), start)
        except DegenerateGeometryError as error:
            raise DegenerateGeometryError(f"complementary needs a pose a frame: {error}") from error
        sample = self._frame_pose
        sample[0] = stamp_ns, pose.position_w, pose.quaternion_wb
        if start is not None:
            position_at_attitude(beacons, seen, start[1], start[0], sample["position_w"][0])
        if not self.initialized:
            self.initialize(sample)
            return
        gains = self._frame_gains
        variance = np.diag(pose.covariance)
        for name, axes in (("pose_position_noise", slice(3)), ("pose_attitude_noise", slice(3, 6))):
            gains[name] = max(self._gains[name][0], math.sqrt(float(variance[axes].mean())))
        self._correct(sample, gains, estimate)

    def report(self, estimate: Record) -> None:
        """Write biases, measurement age and counts into the ESTIMATE (1,)."""
        self._report(self.memory, estimate)

    def warnings(self, rate: float) -> list[str]:
        """Return what is wrong with the gains at this rate (Hz) of poses; empty when
        they are good.
        """
        return gain_warnings(self._parameters, rate)
