"""Mode STARTING of the flight stack: find the gyroscope bias at start-up and on request."""

from __future__ import annotations

import math
from dataclasses import dataclass

from estimation.calibration.gyroscope import GyroscopeCalibration
from quadrotor.errors import MeasurementError
from quadrotor.motor_state import MotorState
from vehicle import mailbox
from vehicle.boards.board import RawSample
from vehicle.boards.imu import ImuCalibrator
from vehicle.calibration.gyroscope import GyroCalibration
from vehicle.estimators.navigation import Navigation
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.modes import Mode
from vehicle.safety.parameters import SafetyParameters

TURNING = (MotorState.ON, MotorState.EMERGENCY)
AT_START = "start"
"""Requester of the calibration at start-up."""


@dataclass(kw_only=True, eq=False)
class GyroscopeStart:
    """Search for the gyroscope bias of a vehicle at rest (Sec. 5.1 of the paper)."""

    safety: SafetyParameters
    tick: TickRecord
    outbox: Outbox
    modes: ModeMachine
    imu_calibrator: ImuCalibrator
    navigation: Navigation
    _running: GyroCalibration | None = None
    _begun_ns: int = 0
    _request: mailbox.CalibrateGyroscope | None = None  # None: start-up
    _motors_reported: bool = False

    def begin(self, request: mailbox.CalibrateGyroscope) -> None:
        """Start to find the bias again; the present one stays in use until then.

        Raises RefusedError.
        """
        why = f"gyroscope calibration by {request.requester}; keep the vehicle still"
        self.modes.move(Mode.STARTING, why)
        self._request, self._running = request, None

    def step(self, sample: RawSample) -> None:
        """Process one sample: at start-up until a bias is found, on request for one attempt."""
        motors_on = sample.motor_state in TURNING
        if motors_on and self._request is None:  # restarted during a landing
            if not self._motors_reported:
                line = (
                    "started while the motors are running: the board is landing by itself; the "
                    "gyroscope is calibrated when they have stopped"
                )
                self.outbox.say(line, mailbox.WARN)
            self._motors_reported, self._running = True, None
            return
        if self._running is None:
            self._begun_ns = self.tick.stamp_ns
            deviation = math.radians(self.safety.gyro_deviation_max)
            self._running = GyroCalibration(self.safety.gyro_samples, deviation)
        try:
            found = self._running.add(self.tick.angular_velocity_b, motors_on=motors_on)
            if found is not None:
                self._check_bias(found)
        except MeasurementError as error:
            self._refuse(str(error))
            return
        if found is not None:
            self._accept(found, self._running.deviation_max, sample.battery_voltage)

    def _check_bias(self, found: GyroscopeCalibration) -> None:
        """Raise MeasurementError for a bias that is too large: a steady turn has no deviation."""
        largest, what = self.safety.gyro_drift_max, "drift"
        if self._request is not None:
            largest, what = self.safety.gyro_change_max, "the drift would change by"
        drift = math.degrees(float(abs(found.bias_b).max()))
        if drift > largest:
            raise MeasurementError(
                f"gyroscope not calibrated: {what} {drift:.1f} °/s, allowed {largest:g}; keep "
                "the vehicle still"
            )

    def _refuse(self, reason: str) -> None:
        request, self._request, self._running = self._request, None, None
        if request is None:
            self.outbox.say(reason, mailbox.WARN)  # and retry
            return
        self.outbox.add(
            mailbox.GyroscopeFound(
                self.tick.stamp_ns, request.request_id, request.requester, reason
            )
        )
        self.modes.move(Mode.READY, f"the gyroscope bias is unchanged: {reason}", mailbox.WARN)

    def _accept(self, found: GyroscopeCalibration, deviation_max: float, voltage: float) -> None:
        request, self._request, self._running = self._request, None, None
        # The samples were already corrected by the bias in use.
        bias_b = self.imu_calibrator.gyroscope_bias_b + found.bias_b
        self.imu_calibrator.set_gyroscope_bias(bias_b)
        self.navigation.reset()  # its estimates come from the uncalibrated gyroscope
        x, y, z = bias_b.tolist()
        deviation_x, deviation_y, deviation_z = found.deviation_b.tolist()
        stamp_ns = self.tick.stamp_ns
        self.outbox.add(
            mailbox.GyroscopeFound(
                stamp_ns=stamp_ns,
                request_id=request.request_id if request else "",
                requester=request.requester if request else AT_START,
                bias_b=(x, y, z),
                deviation_b=(deviation_x, deviation_y, deviation_z),
                samples=found.samples,
                deviation_max=deviation_max,
                seconds=(stamp_ns - self._begun_ns) * 1e-9,
                voltage=voltage,
            )
        )
        degrees = ", ".join(f"{math.degrees(bias):.2f}" for bias in (x, y, z))
        self.modes.move(Mode.READY, f"gyroscope bias {degrees} °/s")
