"""An estimator of the user's own above a built-in one that can take over in any tick."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from estimation.convergence import Convergence, Deviations, Difference, difference
from estimation.estimator import TakesHeading
from estimation.outcome import NORM_TOLERANCE
from estimation.parameters import EstimationParameters
from quadrotor.errors import RefusedError
from quadrotor.records import Record, new_state
from quadrotor.rotations import quaternion_exp, quaternion_multiply, quaternion_normalize, rotate
from quadrotor.vehicle_model import GRAVITY
from vehicle.estimators.contract import ESTIMATOR, OUTPUT_TYPE
from vehicle.estimators.estimator_runner import Runner
from vehicle.plugins.contract import Array
from vehicle.plugins.external import External
from vehicle.plugins.links import Link

GRAVITY_W = np.array([0.0, 0.0, -GRAVITY])
WAITING = 64
"""Measurements of each kind that wait for their tick: a plugin gets one of each in a tick."""
VARIANCES = ("position_variance_w", "velocity_variance_w", "attitude_variance_w")
BIASES = ("gyroscope_bias_b", "accelerometer_bias_b")
FINITE = ("position_w", "velocity_w", "quaternion_wb", *BIASES)


class ExternalEstimator(External):
    """An `estimation.estimator.Estimator` whose state is the answer of a plugin.

    In each tick the built-in estimator beneath is stepped, the answer to the last tick's input is
    read and carried on to this sample by the IMU, and the next input is sent. A missing answer is
    carried on from the one before. Whatever else is asked of it (age, convergence, innovations,
    counts) is the built-in one's. In the tick in which it fails, its last good state is written,
    from which `vehicle.estimators.rescue` changes to the built-in one.

    Args:
        built_in: the built-in estimator.
    """

    def __init__(self, name: str, link: Link, built_in: Runner, waits: bool) -> None:
        super().__init__(ESTIMATOR, name, link, waits)
        self.built_in, self._base = built_in, built_in.estimator
        self._poses: deque[Record] = deque(maxlen=WAITING)
        self._frames: deque[Record] = deque(maxlen=WAITING)
        self._begin()
        # Compiled here and not in the first tick, which would be seconds late.
        self._propagated(self._state, np.zeros(3), np.zeros(3), 0.0)

    def __getattr__(self, name: str) -> object:
        """Return what only some estimators have, like `ignored`, of the built-in one."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._base, name)

    # ------------------------------------------------------------------ the protocol
    @property
    def initialized(self) -> bool:
        return self._base.initialized

    @property
    def measurement_age(self) -> float:
        return self._base.measurement_age

    @property
    def stale(self) -> bool:
        return self._base.stale

    @property
    def deviations(self) -> Deviations | None:
        return self._base.deviations

    @property
    def converged(self) -> bool:
        return self.convergence.reached

    @property
    def convergence(self) -> Convergence:
        """Return the convergence of the built-in one, once the plugin answers near it."""
        if self.failure or not self.is_ready:
            return Convergence(False, self.failure or f"{self.name} is loading")
        if not self._answers:
            return Convergence(False, f"{self.name} has not answered yet")
        try:
            self._check(self._state)
        except RefusedError as error:
            return Convergence(False, str(error))
        return self._base.convergence

    def configure(self, parameters: EstimationParameters) -> None:
        self._base.configure(parameters)
        p = parameters.plugin
        self._bounds = Difference(p.position_max, p.velocity_max, math.radians(p.attitude_max))
        self._out["pose_position_deviation"] = parameters.pose_position_noise
        self._out["pose_attitude_deviation"] = math.radians(parameters.pose_attitude_noise)

    def reset(self) -> None:
        self._base.reset()
        self._begin()

    def initialize(self, pose: Record) -> None:
        self._base.initialize(pose)
        self._begin()

    def take_heading(self) -> None:
        if isinstance(self._base, TakesHeading):
            self._base.take_heading()

    def predict(self, imu: Record, dt: float, state: Record) -> None:
        """Write the state of this sample. Raises RefusedError with the reason when the plugin has
        failed and is not the one that is flown.
        """
        base = self.built_in.state
        self._base.predict(imu, dt, base)
        state[...] = base
        self._out["time"] += dt
        if not self._base.initialized:
            return
        try:
            self._follow(imu, dt)
        except RefusedError as error:
            self.failure = self.failure or str(error)
        if self._answers:
            state[...] = self._state
        if self.failure and not self.flown:
            raise RefusedError(self.failure)

    def correct(self, pose: Record, estimate: Record) -> None:
        self._base.correct(pose, estimate)
        self._poses.append(pose.copy())

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        self._base.correct_bearings(bearings, estimate)
        self._frames.append(bearings.copy())

    def report(self, estimate: Record) -> None:
        """Write what the built-in one reports, with biases and variances of the plugin."""
        self._base.report(estimate)
        if self._answers:
            for name in BIASES:
                estimate[name] = self._newest[name]
            for name in VARIANCES:
                if not np.isnan(self._newest[name]).any():
                    estimate[name] = self._newest[name]

    def warnings(self, rate: float) -> list[str]:
        return self._base.warnings(rate)

    def summary(self) -> str:
        """Return a line about the flight, and begin to count again."""
        apart = f"its position was {self.difference:.4f} m (rms) from that of"
        return f"{super().summary()}; {apart} {self.built_in.name}"

    # ------------------------------------------------------------------ parts
    def _begin(self) -> None:
        """Have the plugin begin at the built-in one's state, once that has one."""
        self._out["reset"] = 1.0
        self._asked = math.nan
        self._answers = False
        self._state, self._newest = new_state(), np.zeros(1, OUTPUT_TYPE)
        self._poses.clear()
        self._frames.clear()

    def _follow(self, imu: Record, dt: float) -> None:
        """Take the answer, carry it on to this sample, and ask for the next. Raises RefusedError
        when the plugin must not be used any more.
        """
        self.becomes_ready()
        if self.failure:
            return
        answer, before = self._answer(), self._state
        if answer is not None:
            before = self._accepted(answer)
        if answer is not None or self._answers:
            state = self._propagated(
                before, imu["specific_force_b"][0], imu["angular_velocity_b"][0], dt
            )
            if answer is not None:
                away = state["position_w"][0] - self.built_in.state["position_w"][0]
                self._squares += float(away @ away)
            if self.flown:
                self._check(state)
            self._state, self._answers = state, True
        self._input(imu, dt)
        self._ask()

    def _accepted(self, answer: Record) -> Record:
        """Return the STATE (1,) of an answer, which becomes the newest. Raises RefusedError for
        one that is no estimate.
        """
        for name in FINITE:
            numbers = answer[name][0]
            if not np.isfinite(numbers).all():
                raise RefusedError(f"it answered {name} {numbers.tolist()}, which is not finite")
        for name in VARIANCES:
            numbers = answer[name][0]
            if not (np.isnan(numbers) | (numbers >= 0.0) & (numbers < math.inf)).all():
                raise RefusedError(f"it answered {name} {numbers.tolist()}, which is no variance")
        quaternion = answer["quaternion_wb"][0]
        if not abs(float(quaternion @ quaternion) - 1.0) < NORM_TOLERANCE:
            raise RefusedError(
                f"it answered quaternion_wb {quaternion.tolist()}, which is not of unit length"
            )
        self._newest, state = answer, new_state()
        for name in ("position_w", "velocity_w"):
            state[name] = answer[name]
        state["quaternion_wb"][0] = quaternion_normalize(quaternion)
        return state

    def _propagated(
        self, last: Record, specific_force_b: Array, angular_velocity_b: Array, dt: float
    ) -> Record:
        """Return the STATE (1,) one sample after the last, by what the IMU measured."""
        before, state, newest = last[0], new_state(), self._newest[0]
        turn = (angular_velocity_b - newest["gyroscope_bias_b"]) * dt
        q = quaternion_normalize(quaternion_multiply(before["quaternion_wb"], quaternion_exp(turn)))
        force = specific_force_b - newest["accelerometer_bias_b"]
        change = (rotate(q, force) + GRAVITY_W) * dt
        state["quaternion_wb"][0] = q
        state["position_w"][0] = before["position_w"] + (before["velocity_w"] + 0.5 * change) * dt
        state["velocity_w"][0] = before["velocity_w"] + change
        # The rate is filtered by the built-in one; the bias is taken off that the plugin answers.
        self._base.report(self.built_in.estimate)
        bias = self.built_in.estimate["gyroscope_bias_b"][0] - newest["gyroscope_bias_b"]
        state["angular_velocity_b"][0] = self.built_in.state["angular_velocity_b"][0] + bias
        return state

    def _check(self, state: Record) -> None:
        """Raise RefusedError when a state is too far from that of the built-in one."""
        apart = difference(state, self.built_in.state)
        if not apart.within(self._bounds):
            raise RefusedError(f"it is {apart} from {self.built_in.name}; allowed {self._bounds}")

    def _input(self, imu: Record, dt: float) -> None:
        out, now = self._out, self._out["time"][0]
        out["dt"] = dt
        if out["reset"][0]:
            for name in ("position_w", "velocity_w", "quaternion_wb"):
                out[f"start_{name}"] = self.built_in.state[name]
        out["specific_force_b"] = imu["specific_force_b"]
        out["angular_velocity_b"] = imu["angular_velocity_b"]
        out["pose_count"] = out["bearing_count"] = 0.0
        if not self.is_ready:
            return
        if self._poses:
            pose = self._poses.popleft()
            out["pose_count"] = 1.0
            out["pose_time"] = now - 1e-9 * (imu["stamp_ns"] - pose["stamp_ns"])
            out["pose_position_w"] = pose["position_w"]
            out["pose_quaternion_wb"] = pose["quaternion_wb"]
        if self._frames:
            frame = self._frames.popleft()
            out["bearing_count"], out["bearing_deviation"] = frame["count"], frame["sigma"]
            out["bearing_time"] = now - 1e-9 * (imu["stamp_ns"] - frame["stamp_ns"])
            out["beacon_w"], out["bearing_b"] = frame["beacon_w"], frame["bearing_b"]
