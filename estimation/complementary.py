"""The complementary filter in SE(3) of Sec. 6.1: prediction at the IMU's rate, late poses.

A pose is compared with the estimate at the pose's own stamp and applied at once. No measurement
is ever held, so a lost tracker leaves a prediction with the last biases (dead reckoning).
"""

from __future__ import annotations

import math
from collections import Counter
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from estimation.attitude_filter import (
    attitude_gains,
    attitude_innovation,
    propagate_attitude,
)
from estimation.history import amend, recall, remember
from estimation.memory import new_memory
from estimation.parameters import EstimationParameters, estimation_record
from estimation.rate_filter import low_pass
from estimation.stability import gain_warnings
from estimation.translation_observer import (
    acceleration_of,
    propagate_translation,
    translation_gains,
)
from quadrotor.errors import MeasurementError
from quadrotor.records import Record
from quadrotor.rotations import rotate, rotate_inverse

AHEAD_NS = 20_000_000
"""A pose may be this far ahead of the newest IMU sample: clock error and serial latency."""


class Outcome(IntEnum):
    """What became of a pose."""

    APPLIED = 0
    TOO_OLD = 1  # older than the history
    NOT_NEWER = 2  # not newer than the last pose applied
    AHEAD = 3  # more than AHEAD_NS ahead of the IMU
    INVALID = 4  # not finite, or the quaternion is not unit


_APPLIED, _TOO_OLD, _NOT_NEWER, _AHEAD, _INVALID = (int(o) for o in Outcome)


@njit(cache=True)
def predict(memory: Record, imu: Record, gains: Record, dt: float, state: Record) -> None:
    """Advance all filters by one IMU sample; eq. 11 and 12 without their innovation terms.

    Args:
        memory: (N,) ESTIMATOR_MEMORY. imu: (N,) IMU_SAMPLE. state: (N,) STATE, written.
        gains: (1,) ESTIMATION_GAINS.
        dt: s since the last sample.

    Rate and acceleration are the mean of this sample and the last, turned at their own
    attitudes: second order, where holding the newest sample leads by half a period.
    """
    g = gains[0]
    rate = np.empty(3)
    mean_rate = np.empty(3)
    for k in range(memory.shape[0]):
        m, sample, out = memory[k], imu[k], state[k]
        if not m.primed:
            m.primed = 1
            for i in range(3):
                m.rate_b[i] = sample.angular_velocity_b[i]
                m.specific_force_b[i] = sample.specific_force_b[i]
                m.filtered_rate_b[i] = sample.angular_velocity_b[i] - m.gyroscope_bias_b[i]
        for i in range(3):
            rate[i] = sample.angular_velocity_b[i] - m.gyroscope_bias_b[i]
            mean_rate[i] = 0.5 * (rate[i] + m.rate_b[i] - m.gyroscope_bias_b[i])
        low_pass(m.filtered_rate_b, rate, g.rate_low_pass, dt)
        if m.initialized:
            start_w = acceleration_of(m.quaternion_wb, m.specific_force_b, m.accelerometer_bias_b)
            propagate_attitude(m.quaternion_wb, mean_rate, g.norm_penalty, dt)
            end_w = acceleration_of(
                m.quaternion_wb, sample.specific_force_b, m.accelerometer_bias_b
            )
            propagate_translation(m.position_w, m.velocity_w, start_w, end_w, dt)
        m.stamp_ns = sample.stamp_ns
        remember(m)
        for i in range(3):
            m.rate_b[i] = sample.angular_velocity_b[i]
            m.specific_force_b[i] = sample.specific_force_b[i]
            out.position_w[i] = m.position_w[i]
            out.velocity_w[i] = m.velocity_w[i]
            out.angular_velocity_b[i] = m.filtered_rate_b[i]
        for i in range(4):
            out.quaternion_wb[i] = m.quaternion_wb[i]


@njit(cache=True)
def start(memory: Record, pose: Record) -> int:
    """Put filter 0 at pose 0, at rest, biases kept; the history starts anew."""
    m, z = memory[0], pose[0]
    if not usable(z):
        return _INVALID
    norm = math.sqrt(
        z.quaternion_wb[0] ** 2
        + z.quaternion_wb[1] ** 2
        + z.quaternion_wb[2] ** 2
        + z.quaternion_wb[3] ** 2
    )
    for i in range(3):
        m.position_w[i] = z.position_w[i]
        m.velocity_w[i] = 0.0
    for i in range(4):
        m.quaternion_wb[i] = z.quaternion_wb[i] / norm
    m.pose_stamp_ns = z.stamp_ns
    m.initialized = 1
    m.ring_count = 0
    if not m.primed:
        m.stamp_ns = z.stamp_ns
    remember(m)
    return _APPLIED


@njit(cache=True)
def usable(z: Any) -> bool:
    """The pose is finite and its quaternion within 1 % of unit length."""
    total = 0.0
    norm2 = 0.0
    for i in range(3):
        total += abs(z.position_w[i])
    for i in range(4):
        norm2 += z.quaternion_wb[i] * z.quaternion_wb[i]
    return math.isfinite(total) and abs(norm2 - 1.0) < 0.02


@njit(cache=True)
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
    innovation_w, innovation_b, turn_b = np.empty(3), np.empty(3), np.empty(3)
    shift = np.empty((3, 3))
    for k in range(memory.shape[0]):
        m, z, out = memory[k], pose[k], estimate[k]
        outcome[k] = _INVALID
        if not usable(z):
            continue
        outcome[k] = _NOT_NEWER
        if z.stamp_ns <= m.pose_stamp_ns:
            continue
        outcome[k] = _AHEAD
        if z.stamp_ns > m.stamp_ns + AHEAD_NS:
            continue
        outcome[k] = _TOO_OLD
        back = recall(m, z.stamp_ns)
        if back < 0:
            continue
        outcome[k] = _APPLIED
        interval = 1e-9 * (z.stamp_ns - m.pose_stamp_ns)
        m.pose_stamp_ns = z.stamp_ns

        l_p, l_v, l_a = translation_gains(
            g.position_bandwidth, g.accelerometer_bias_bandwidth, interval
        )
        l_q, l_g = attitude_gains(g.attitude_bandwidth, g.gyroscope_bias_bandwidth, interval)
        attitude_innovation(m.past_quaternion_wb, z.quaternion_wb, innovation_b)
        for i in range(3):
            e = z.position_w[i] - m.past_position_w[i]
            innovation_w[i] = e
            shift[0, i], shift[1, i], shift[2, i] = l_p * e, l_v * e, l_a * e
            turn_b[i] = l_q * innovation_b[i]
            out.position_innovation_w[i] = e
            out.attitude_innovation_b[i] = innovation_b[i]
        amend(m, back, z.stamp_ns, shift, rotate(m.past_quaternion_wb, turn_b))

        # b_dot = -R_wb^T Kb e: an acceleration that is missing is a bias that is too large.
        innovation_past_b = rotate_inverse(m.past_quaternion_wb, innovation_w)
        a_max, w_max = g.accelerometer_bias_limit, g.gyroscope_bias_limit
        for i in range(3):
            bias = m.accelerometer_bias_b[i] - l_a * innovation_past_b[i]
            m.accelerometer_bias_b[i] = min(max(bias, -a_max), a_max)
            bias = m.gyroscope_bias_b[i] - l_g * innovation_b[i]
            m.gyroscope_bias_b[i] = min(max(bias, -w_max), w_max)


@njit(cache=True)
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
        memory = self._memory
        age_ns = int(memory["stamp_ns"][0]) - int(memory["pose_stamp_ns"][0])
        return max(0.0, 1e-9 * age_ns)

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
        if start(self._memory, pose) != Outcome.APPLIED:
            raise _refusal(pose)
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
