"""The flight stack on the ground: find the gyroscope's drift, turn one motor."""

from __future__ import annotations

import math

from estimation.calibration.gyroscope import GyroscopeCalibration
from quadrotor.errors import MeasurementError
from vehicle.calibration.gyroscope import GyroCalibration
from vehicle.flight.modes import Mode
from vehicle.flight.stack_modes import MOTOR_START_GRACE_NS, StackModes
from vehicle.microcontroller.microcontroller import RawSample
from vehicle.processes import mailbox
from vehicle_link.serial.ids import MotorState

TURNING = (MotorState.ON, MotorState.EMERGENCY)
AT_START = "start"
"""Requester of the calibration that nobody asked for."""


class StackOnGround(StackModes):
    """Modes STARTING and BENCH."""

    def begin_gyroscope(self, command: mailbox.CalibrateGyroscope) -> None:
        """Find the drift anew; the one in use stays until there is another. Raises RefusedError."""
        why = f"gyroscope calibration by {command.requester}; keep the vehicle still"
        self.move(Mode.STARTING, why)
        self._asked, self._gyro = command, None

    def _calibrate_gyroscope(self, sample: RawSample) -> None:
        """Take one sample of STARTING: at the start tried until the drift is found, on request
        once.
        """
        safety, motors_on = self.parameters.safety, sample.motor_state in TURNING
        if motors_on and self._asked is None:  # started again while the microcontroller lands
            if not self._told_motors:
                self.say("gyroscope not calibrated: motors run; waiting for them", mailbox.WARN)
            self._told_motors, self._gyro = True, None
            return
        if self._gyro is None:
            self._gyro_begun_ns = self._stamp_ns
            deviation = math.radians(safety.gyro_deviation_max)
            self._gyro = GyroCalibration(safety.gyro_samples, deviation)
        try:
            found = self._gyro.add(self.imu["angular_velocity_b"][0], motors_on=motors_on)
            if found is not None:
                self._check_drift(found)
        except MeasurementError as error:
            self._gyroscope_refused(str(error))
            return
        if found is not None:
            self._gyroscope_found(found, self._gyro.deviation_max, sample.battery_voltage)

    def _check_drift(self, found: GyroscopeCalibration) -> None:
        """Raise MeasurementError for a drift too large: a steady turn has no deviation."""
        safety = self.parameters.safety
        most, of = safety.gyro_drift_max, "drift"
        if self._asked is not None:
            most, of = safety.gyro_change_max, "the drift would change by"
        drift = math.degrees(float(abs(found.bias_b).max()))
        if drift > most:
            raise MeasurementError(
                f"gyroscope not calibrated: {of} {drift:.1f} deg/s, allowed {most:g}; keep the "
                "vehicle still"
            )

    def _gyroscope_refused(self, reason: str) -> None:
        asked, self._gyro = self._asked, None
        if asked is None:
            self.say(reason, mailbox.WARN)  # and tried again
            return
        self._asked = None
        told = mailbox.GyroscopeFound(self._stamp_ns, asked.request_id, asked.requester, reason)
        self.outbox.append(told)
        self.move(Mode.READY, f"the gyroscope's drift stays: {reason}", mailbox.WARN)

    def _gyroscope_found(
        self, found: GyroscopeCalibration, deviation_max: float, voltage: float
    ) -> None:
        asked, self._asked, self._gyro = self._asked, None, None
        # The samples were corrected by the drift in use.
        bias_b = self.imu_calibrator.gyroscope_bias_b + found.bias_b
        self.imu_calibrator.set_gyroscope_bias(bias_b)
        self.navigation.reset()  # it saw the uncalibrated gyroscope and learnt from it
        x, y, z = bias_b.tolist()
        deviation_x, deviation_y, deviation_z = found.deviation_b.tolist()
        self.outbox.append(
            mailbox.GyroscopeFound(
                stamp_ns=self._stamp_ns,
                request_id=asked.request_id if asked else "",
                requester=asked.requester if asked else AT_START,
                bias_b=(x, y, z),
                deviation_b=(deviation_x, deviation_y, deviation_z),
                samples=found.samples,
                deviation_max=deviation_max,
                seconds=(self._stamp_ns - self._gyro_begun_ns) * 1e-9,
                voltage=voltage,
            )
        )
        degrees = ", ".join(f"{math.degrees(b):.2f}" for b in (x, y, z))
        self.move(Mode.READY, f"gyroscope bias {degrees} deg/s")

    def _turn_on_bench(self, sample: RawSample, dt: float) -> tuple[int, int, int, int] | None:
        """Return references of one tick of BENCH, None when it is over."""
        bench = self.bench
        why = self._bench_fault(sample) or bench.over(
            self._stamp_ns, self.imu["angular_velocity_b"][0], dt
        )
        if why:
            self.move(Mode.READY, f"{bench} stopped: {why}", mailbox.WARN)
            self._rest()
            return None
        self._rest()
        self._wanted_references[bench.motor - 1] = bench.reference
        return bench.references

    def _bench_fault(self, sample: RawSample) -> str:
        """Return what the battery and the microcontroller have against turning motors on the bench;
        "" for nothing.
        """
        if self.supervisor.battery_spent:
            return f"battery at {sample.battery_voltage:.1f} V"
        if sample.motor_state == MotorState.EMERGENCY:
            return "the microcontroller's emergency: commands were missing, or the battery"
        bench = self.bench
        if sample.motor_state == MotorState.ON:
            bench.started = True
        elif bench.started or self._stamp_ns - self._armed_ns > MOTOR_START_GRACE_NS:
            name = MotorState(sample.motor_state).name.lower()
            return self.obstacle or f"the microcontroller reports motors {name}"
        return ""
