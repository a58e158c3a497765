"""The complementary filter in SE(3) of Sec. 6.1: prediction at the IMU's rate, late poses.

A pose is compared with the estimate at the pose's own stamp and applied at once. No measurement
is ever held, so a lost tracker leaves a prediction with the last biases (dead reckoning).
"""

from __future__ import annotations

import math
from collections import Counter
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from estimation.attitude_filter import (
    attitude_gains,
    attitude_innovation,
    to_world,
    turn_pose,
)
from estimation.history import amend, recall, remember
from estimation.memory import new_memory
from estimation.parameters import EstimationParameters, estimation_record
from estimation.rate_filter import low_pass
from estimation.stability import gain_warnings
from estimation.translation_observer import (
    acceleration_of,
    move_pose,
    translation_gains,
)
from quadrotor.compiled import compiled
from quadrotor.errors import MeasurementError
from quadrotor.records import Record

AHEAD_NS = 20_000_000
"""A pose may be this far ahead of the newest IMU sample: clock error and serial latency."""
NORM_TOLERANCE = 0.02
"""How far |q|^2 of a measured pose may be from 1."""


class Outcome(IntEnum):
    """What became of a pose."""

    APPLIED = 0
    TOO_OLD = 1  # older than the history
    NOT_NEWER = 2  # not newer than the last pose applied
    AHEAD = 3  # more than AHEAD_NS ahead of the IMU
    INVALID = 4  # not finite, or the quaternion is not unit


_APPLIED, _TOO_OLD, _NOT_NEWER, _AHEAD, _INVALID = (int(o) for o in Outcome)


@compiled
def predict(memory: Record, imu: Record, gains: Record, dt: float, state: Record) -> None:
    """Advance all filters by one IMU sample; eqs. 11 and 12 without their innovation terms.

    Args:
        memory: (N,) ESTIMATOR_MEMORY. imu: (N,) IMU_SAMPLE. state: (N,) STATE, written.
        gains: (1,) ESTIMATION_GAINS.
        dt: s since the last sample.

    Rate and acceleration are the mean of this sample and the last, turned at their own
    attitudes: second order, where holding the newest sample leads by half a period.
    """
    g = gains[0]
    mean = np.empty(3)
    for k in range(memory.shape[0]):
        m, sample, out = memory[k], imu[k], state[k]
        pose, bias, last = m.pose, m.gyroscope_bias_b, m.rate_b
        rate, force = sample.angular_velocity_b, sample.specific_force_b
        filtered, last_force = m.filtered_rate_b, m.specific_force_b
        if not m.primed:
            m.primed = 1
            for i in range(3):
                last[i], last_force[i] = rate[i], force[i]
                filtered[i] = rate[i] - bias[i]
        low_pass(filtered, rate, bias, g.rate_low_pass, dt)
        if m.initialized:
            for i in range(3):
                mean[i] = 0.5 * (rate[i] + last[i]) - bias[i]
            start_w = acceleration_of(pose, last_force, m.accelerometer_bias_b)
            turn_pose(pose, mean[0], mean[1], mean[2], g.norm_penalty, dt)
            end_w = acceleration_of(pose, force, m.accelerometer_bias_b)
            move_pose(pose, m.velocity_w, start_w, end_w, dt)
        m.stamp_ns = sample.stamp_ns
        remember(m)
        for i in range(3):
            last[i], last_force[i] = rate[i], force[i]
            out.position_w[i] = pose[i]
            out.velocity_w[i] = m.velocity_w[i]
            out.angular_velocity_b[i] = filtered[i]
        for i in range(4):
            out.quaternion_wb[i] = pose[3 + i]


@compiled
def correct(
    memory: Record, pose: Record, gains: Record, estimate: Record, outcome: npt.NDArray[np.int64]
) -> None:
    """Apply one pose to each initialized filter (eqs. 11 and 12, exact for the interval).

    Args:
        memory: (N,) ESTIMATOR_MEMORY. pose: (N,) POSE_SAMPLE. gains: (1,) ESTIMATION_GAINS.
        estimate: (N,) ESTIMATE, innovations written when applied.
        outcome: (N,) of Outcome, written.
    """
    g = gains[0]
    for k in range(memory.shape[0]):
        m, z, out = memory[k], pose[k], estimate[k]
        p, q, past, stamp_ns = z.position_w, z.quaternion_wb, m.past, z.stamp_ns
        norm2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
        if not (math.isfinite(p[0] + p[1] + p[2]) and abs(norm2 - 1.0) < NORM_TOLERANCE):
            outcome[k] = _INVALID
            continue
        if stamp_ns <= m.pose_stamp_ns:
            outcome[k] = _NOT_NEWER
            continue
        if stamp_ns > m.stamp_ns + AHEAD_NS:
            outcome[k] = _AHEAD
            continue
        back = recall(m, stamp_ns)
        if back < 0:
            outcome[k] = _TOO_OLD
            continue
        outcome[k] = _APPLIED
        interval = 1e-9 * (stamp_ns - m.pose_stamp_ns)
        m.pose_stamp_ns = stamp_ns

        l = translation_gains(  # noqa: E741 - L of the derivation there
            g.position_bandwidth, g.accelerometer_bias_bandwidth, interval
        )
        l_q, l_g = attitude_gains(g.attitude_bandwidth, g.gyroscope_bias_bandwidth, interval)
        e_w = (p[0] - past[0], p[1] - past[1], p[2] - past[2])
        turn_b = attitude_innovation(past, q)
        turn_w = to_world(past, 1.0, l_q * turn_b[0], l_q * turn_b[1], l_q * turn_b[2])
        # b_dot = -R_wb^T Kb e: an acceleration that is missing is a bias that is too large.
        e_b = to_world(past, -1.0, e_w[0], e_w[1], e_w[2])
        amend(m, back, stamp_ns, e_w, l, turn_w)
        a_max, w_max = g.accelerometer_bias_limit, g.gyroscope_bias_limit
        a_bias, w_bias = m.accelerometer_bias_b, m.gyroscope_bias_b
        for i in range(3):
            a_bias[i] = min(max(a_bias[i] - l[2] * e_b[i], -a_max), a_max)
            w_bias[i] = min(max(w_bias[i] - l_g * turn_b[i], -w_max), w_max)
            out.position_innovation_w[i] = e_w[i]
            out.attitude_innovation_b[i] = turn_b[i]


@compiled
def report(memory: Record, estimate: Record) -> None:
    """Write biases and measurement age of (N,) ESTIMATOR_MEMORY into (N,) ESTIMATE."""
    for k in range(memory.shape[0]):
        m, out = memory[k], estimate[k]
        for i in range(3):
            out.accelerometer_bias_b[i] = m.accelerometer_bias_b[i]
            out.gyroscope_bias_b[i] = m.gyroscope_bias_b[i]
        out.measurement_age = math.inf
        if m.initialized:
            out.measurement_age = max(0.0, 1e-9 * (m.stamp_ns - m.pose_stamp_ns))


class ComplementaryEstimator:
    """The `Estimator` of the paper, with bias states and late measurements.

    Attributes:
        ignored: how many poses were not applied, by Outcome.
    """

    name = "complementary"

    def __init__(self, parameters: EstimationParameters | None = None) -> None:
        self.ignored: Counter[Outcome] = Counter()
        self._memory = new_memory()
        # Views made once: looking a field up by name takes longer than the subtraction.
        self._stamp_ns = self._memory["stamp_ns"]
        self._pose_stamp_ns = self._memory["pose_stamp_ns"]
        self._outcome = np.zeros(1, np.int64)
        self._initialized = False
        self.configure(parameters or EstimationParameters())

    def configure(self, parameters: EstimationParameters) -> None:
        """Take new gains; state and biases are kept."""
        self._parameters = parameters.model_copy()
        self._gains = estimation_record(parameters)

    @property
    def initialized(self) -> bool:
        """A first pose was taken."""
        return self._initialized

    @property
    def measurement_age(self) -> float:
        """Seconds from the newest pose applied to the newest IMU sample; inf before one came."""
        if not self._initialized:
            return math.inf
        age_ns = self._stamp_ns.item() - self._pose_stamp_ns.item()
        return 1e-9 * age_ns if age_ns > 0 else 0.0

    @property
    def stale(self) -> bool:
        """The newest pose is older than `measurement_timeout`: the estimate is only predicted."""
        return self.measurement_age > self._parameters.measurement_timeout

    @property
    def memory(self) -> Record:
        """The filter's memory, shape (1,), for logs and tests."""
        return self._memory

    def reset(self) -> None:
        """Forget everything, biases included."""
        self._memory[:] = new_memory()
        self._initialized = False
        self.ignored.clear()

    def initialize(self, pose: Record) -> None:
        """Start anew at a POSE_SAMPLE (1,), at rest, with the biases so far.

        Raises MeasurementError when the pose is not finite or its quaternion not unit.
        """
        m, position, quaternion = self._memory[0], pose["position_w"][0], pose["quaternion_wb"][0]
        norm2 = float(quaternion @ quaternion)
        if not (np.isfinite(position).all() and abs(norm2 - 1.0) < NORM_TOLERANCE):
            raise _refusal(pose)
        m["pose"][:3], m["pose"][3:] = position, quaternion / math.sqrt(norm2)
        m["velocity_w"] = 0.0
        m["pose_stamp_ns"] = pose["stamp_ns"][0]
        m["ring_count"] = 0  # the next prediction starts the history
        m["initialized"] = 1
        self._initialized = True

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Advance by an IMU_SAMPLE (1,) that came `dt` s after the last; write the STATE (1,).

        Before the first pose only the angular velocity is estimated.
        """
        predict(self._memory, imu, self._gains, dt, state)

    def correct(self, pose: Record, estimate: Record) -> None:
        """Apply a POSE_SAMPLE (1,); write its innovations into the ESTIMATE (1,).

        The first pose of all initializes. A pose that is not newer than the last, older than
        the history or ahead of the IMU is counted in `ignored`. Raises MeasurementError when it
        is not finite or its quaternion not unit.
        """
        if not self._initialized:
            self.initialize(pose)
            return
        correct(self._memory, pose, self._gains, estimate, self._outcome)
        outcome = int(self._outcome[0])
        if outcome == _APPLIED:
            return
        self.ignored[Outcome(outcome)] += 1
        if outcome == _INVALID:
            raise _refusal(pose)

    def report(self, estimate: Record) -> None:
        """Write biases and measurement age into the ESTIMATE (1,)."""
        report(self._memory, estimate)

    def warnings(self, rate: float) -> list[str]:
        """What is wrong with the gains at this rate (Hz) of poses; empty when nothing."""
        return gain_warnings(self._parameters, rate)


def _refusal(pose: Record) -> MeasurementError:
    position, quaternion = pose["position_w"][0].tolist(), pose["quaternion_wb"][0].tolist()
    return MeasurementError(
        f"pose with position {position} m and quaternion {quaternion} cannot be used: "
        "allowed are finite positions and quaternions (w, x, y, z) of length 1; check the tracker"
    )
