"""One vehicle's flight stack: the whole tick on one screen.

Data goes one way: sample -> estimator -> state -> supervisor -> behavior -> reference ->
controller -> thrusts -> motor references. The tick is clocked by the stamps of the IMU and never
reads a clock, so the same code flies in real time, faster, and in replay, with identical results
for identical input. Only the caller's thread may touch it.
"""

from __future__ import annotations

import math

from bearing_sim.beacons import parse_layout
from control.behaviors.ground import stand
from control.behaviors.table import BehaviorName
from control.controller import Controller
from estimation.estimator import Estimator
from quadrotor.errors import MeasurementError
from quadrotor.vehicle_model import GRAVITY
from vehicle import mailbox
from vehicle.bearings_guard import BearingsGuard
from vehicle.commands import CommandHandler
from vehicle.gyro_calibration import GyroCalibration
from vehicle.microcontroller import RawSample
from vehicle.modes import Mode, check_move
from vehicle.parameters import VehicleParameters
from vehicle.stack_parts import StackParts
from vehicle.status_writer import FLYING
from vehicle.supervisor import Reaction, Verdict
from vehicle_link.serial.ids import MotorState

LONGEST_STEP = 0.05
"""s: after a longer gap between samples the filters are stepped by this much only."""
NOMINAL_STEP = 0.002
MOTOR_START_GRACE_NS = 1_500_000_000


class FlightStack(StackParts):
    """The vehicle's behaviour between one IMU sample and the next motor references.

    Args:
        parameters: the vehicle's tree; this stack becomes its only writer.
        estimator, controller: plugins, any object with the protocol's methods; defaults are the
            estimator and the law that the parameters name.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        estimator: Estimator | None = None,
        controller: Controller | None = None,
    ) -> None:
        super().__init__(parameters, estimator, controller)
        self.commands = CommandHandler(self)
        self.guard = BearingsGuard(self)
        self.configure()

    # ------------------------------------------------------------------ the tick
    def tick(self, sample: RawSample) -> tuple[int, int, int, int] | None:
        """One IMU sample in, four motor references (counts) out, None while motors are off."""
        dt = self._advance_time(sample.stamp_ns)
        if dt <= 0.0:
            return None
        self.imu_calibrator.calibrate(sample, self.imu)
        if self.mode is Mode.STARTING:
            self._calibrate_gyroscope()

        airborne = self.ground.airborne
        self.navigation.step(self.imu, dt, self.state, self.estimate)
        # The wrench is still the last tick's: what the vehicle obeyed until now.
        self.mass.step(self.state, self.actuators, airborne, dt, self.estimate)
        if self.steering.follow_battery(sample.battery_voltage, dt):
            self.behaviors.model = self.steering.model

        pose_age = self.navigation.active.measurement_age
        verdict = self.supervisor.step(
            self._stamp_ns,
            airborne=airborne,
            voltage=sample.battery_voltage,
            pose_age=pose_age,
            tilt=self.tilt,
        )
        if verdict is not None:
            self._react(verdict)
        if self.guard.on:
            self.guard.step()

        flying = self.mode in FLYING
        if flying and self.behaviors.name is not BehaviorName.GROUND:
            self.behaviors.step(
                self._stamp_ns,
                dt,
                self.state,
                self._joy,
                airborne,
                self._wrench.item(0),
                self.reference,
            )
            self.steering.controller.step(self.state, self.reference, airborne, dt, self.actuators)
            if self.behaviors.aborted:
                self.say(f"braking: {self.behaviors.aborted}", mailbox.WARN)
                self.behaviors.aborted = ""
            self._watch_ground(dt)
        elif flying:
            self._idle()
        else:
            self._rest()
        motors = self._motor_references(sample, flying)
        self._write_status(sample, pose_age)
        return motors

    # ------------------------------------------------------------------ inputs between ticks
    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        """Carry out or refuse one command; the reply says why."""
        return self.commands.handle(command)

    def measure(self, measurement: mailbox.Measurement) -> None:
        """Take one measurement; it acts at the next tick."""
        if isinstance(measurement, mailbox.Pose | mailbox.Bearings):
            self.navigation.measure(measurement)
        elif isinstance(measurement, mailbox.Joy):
            self._joy = (measurement.stamp_ns, measurement.axes, measurement.enabled)
        elif isinstance(measurement, mailbox.Heartbeat):
            self.supervisor.heard(measurement.stamp_ns)

    def loop_statistics(
        self, *, rate: float, p50: float, p99: float, longest: float, missed: float, real_time: bool
    ) -> None:
        """What the loop measured of itself over the last second (Hz, s, s, s, share 0..1)."""
        self._status_writer.loop(rate, p50, p99, longest, missed)
        self._status_writer.real_time = real_time

    def configure(self) -> None:
        """Hand the present parameters to every part; called at a tick boundary."""
        p = self.parameters
        self.steering.configure(p.control, p.model)
        self.behaviors.model = self.steering.model
        if p.beacons.layout != self._layout:
            self._layout = p.beacons.layout
            self.navigation.place(parse_layout(self._layout))
        self.navigation.configure(p.estimation)
        self.guard.configure()
        self._pose_timeout = p.estimation.measurement_timeout
        self.imu_calibrator.configure(p.imu)
        self.status["parameter_revision"] = self.store.revision
        self.mass.configure(p.mass)
        self.behaviors.hover_thrust = p.model.mass * GRAVITY
        self.behaviors.control = p.control

    # ------------------------------------------------------------------ mode changes
    def move(self, mode: Mode, why: str, level: int = mailbox.INFO) -> None:
        """Change the mode by the table of vehicle.modes and say so. Raises RefusedError."""
        check_move(self.mode, mode)
        self.mode = mode
        if mode is Mode.ARMED:
            self.motor_state_wanted = MotorState.ON
            self._armed_ns = self._stamp_ns
            self.ground.arm(float(self.state["position_w"][0, 2]))
            self.supervisor.begin_flight()
            self.guard.begin_flight()
        elif mode in (Mode.READY, Mode.CUT):
            self.motor_state_wanted = MotorState.OFF
            self.ground.disarm()
            self.behaviors.reset()
            self.controller.reset()
        self.say(f"{mode.name.lower().replace('_', ' ')}: {why}", level)

    # ------------------------------------------------------------------ parts of the tick
    def _advance_time(self, stamp_ns: int) -> float:
        dt = (stamp_ns - self._stamp_ns) * 1e-9 if self._stamp_ns else NOMINAL_STEP
        if dt <= 0.0:
            return 0.0
        self._stamp_ns = stamp_ns
        self._sequence[0] += 1
        return min(dt, LONGEST_STEP)

    def _calibrate_gyroscope(self) -> None:
        p = self.parameters
        if self._gyro is None:
            self.imu_calibrator.clear_gyroscope_bias()
            deviation = math.radians(p.safety.gyro_deviation_max)
            self._gyro = GyroCalibration(p.safety.gyro_samples, deviation)
            return
        try:
            bias = self._gyro.add(self.imu["angular_velocity_b"][0])
        except MeasurementError as error:
            self.say(str(error), mailbox.WARN)
            return
        if bias is not None:
            self.imu_calibrator.set_gyroscope_bias(bias)
            self.navigation.reset()  # it saw the uncalibrated gyroscope and learnt from it
            degrees = ", ".join(f"{math.degrees(b):.2f}" for b in bias)
            self._gyro = None
            self.move(Mode.READY, f"gyroscope bias {degrees} deg/s")

    def _react(self, verdict: Verdict) -> None:
        if verdict.reaction is Reaction.CUT:
            self.move(Mode.CUT, verdict.reason, mailbox.ERROR)
        elif verdict.reaction is Reaction.LAND:
            if self.mode is Mode.ARMED:
                self.land_now(verdict.reason)
        elif self.behaviors.name not in (BehaviorName.LAND, BehaviorName.BRAKE):
            self._override("brake")
            self.say(f"braking: {verdict.reason}", mailbox.WARN)

    def land_now(self, why: str) -> None:
        """Enter EMERGENCY_LAND: land from here, refuse everything but cut."""
        self.move(Mode.EMERGENCY_LAND, why, mailbox.ERROR)
        self._override("land")

    def _override(self, behavior: str) -> None:
        """Start `behavior` by the vehicle's own decision; the table allows it from any flight."""
        self.behaviors.request(behavior, {}, self.state, armed=True, airborne=True)

    def _watch_ground(self, dt: float) -> None:
        ground, p = self.ground, self.parameters
        landing = self.behaviors.name is BehaviorName.LAND
        if ground.airborne:
            ground.feel(
                self._specific_force.item(2), self._wrench.item(0), p.safety.landing_support, dt
            )
        elif not landing:
            ground.rise(float(self.state["position_w"][0, 2]))
        carried = landing and ground.carried >= p.behavior.landing_dwell
        if (carried or self.behaviors.landed) and ground.touch_down(self._stamp_ns):
            self.behaviors.reset()
            self.controller.reset()
            self.say("touched down")

    def _idle(self) -> None:
        """Armed on the ground: motors turn slowly, the reference follows the state."""
        stand(self.state, self.reference)
        self.controller.idle(self.actuators)
        if self.ground.rested(self._stamp_ns) >= self.parameters.safety.disarm_after_landing:
            self.move(Mode.READY, "landed")

    def _rest(self) -> None:
        stand(self.state, self.reference)
        self.actuators[...] = self._off

    def _motor_references(
        self, sample: RawSample, flying: bool
    ) -> tuple[int, int, int, int] | None:
        if not flying:
            return None
        started = self._stamp_ns - self._armed_ns > MOTOR_START_GRACE_NS
        if started and sample.motor_state != MotorState.ON:
            state = MotorState(sample.motor_state).name.lower()
            self.move(Mode.CUT, f"microcontroller reports motors {state}", mailbox.ERROR)
            return None
        return self._rounding.round(self._wanted_references)

    def _write_status(self, sample: RawSample, pose_age: float) -> None:
        self._status_writer.write(
            mode=self.mode,
            behavior=self.behaviors.name,
            airborne=self.ground.airborne,
            supervisor_flags=self.supervisor.flags,
            bearings_flags=self.guard.flags,
            stale_pose=pose_age > self._pose_timeout,
            saturated=self._scaling.item() < 1.0,
            tilt_limited=self.controller.tilt_limited,
            voltage=sample.battery_voltage,
            pressure=sample.pressure,
        )
