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
from control.behaviors.near_hovering import Level
from control.behaviors.table import BehaviorName
from control.controller import Controller
from estimation.estimator import Estimator
from estimation.outcome import Agreement
from quadrotor.vehicle_model import GRAVITY
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.flight.commands import CommandHandler
from vehicle.flight.lateness import LoopCounts, LoopStatistics
from vehicle.flight.modes import FLYING, ControlMode, Mode
from vehicle.flight.stack_ground import StackOnGround
from vehicle.microcontroller.microcontroller import RawSample
from vehicle.parameters import VehicleParameters
from vehicle.processes import mailbox
from vehicle.safety.supervisor import Situation
from vehicle_link.serial.ids import MotorState

LONGEST_STEP = 0.05
"""s: after a longer gap between samples laws and behaviors are stepped by this much only."""
LONGEST_GAP = 1.0
"""s that estimators predict at most: beyond nobody knows where the vehicle went, and a stamp that
jumped must not throw the estimate away."""
NOMINAL_STEP = 0.002
LANDING = (BehaviorName.LAND, BehaviorName.EMERGENCY_LANDING)


class FlightStack(StackOnGround):
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
        self.guard = BearingsGuard(
            parameters,
            self.state,
            self.navigation,
            self.behaviors,
            self.ground,
            say=self.say,
            apply=self.commands.apply,
            land=self.land_now,
        )
        self.configure()

    # ------------------------------------------------------------------ the tick
    def tick(self, sample: RawSample) -> tuple[int, int, int, int] | None:
        """Take one IMU sample, and return four command bytes, None while nothing is to be
        commanded.

        They are motor references (counts), or what `flight_control_mode` says.
        """
        since = self._advance_time(sample.stamp_ns)
        if since <= 0.0:
            return None
        dt = min(since, LONGEST_STEP)
        self.imu_calibrator.calibrate(sample, self.imu)
        if self.mode is Mode.STARTING:
            self._calibrate_gyroscope(sample)

        airborne = self.ground.airborne
        self.navigation.step(self.imu, since, self.state, self.estimate)
        # The wrench is still the last tick's: what the vehicle obeyed until now.
        self.mass.step(self.state, self.actuators, self._weighs(airborne), since, self.estimate)
        if self.mass.used:
            self._fly_on(self.mass.mass)
        self._observe(airborne, dt)
        if self.steering.follow_battery(sample.battery_voltage, dt):
            self.behaviors.model = self.steering.model

        pose_age = self.navigation.active.measurement_age
        self._follow_altitude(sample, since)
        verdict = self.supervisor.step(self._stamp_ns, self._look(sample, pose_age))
        if verdict is not None and self.mode in FLYING:
            self.react(verdict)
        if self.guard.on:
            self.guard.step(armed=self.mode is Mode.ARMED)
        if self.mode in FLYING:
            self.heed(sample)

        command = None
        if self.mode is Mode.BENCH:
            command = self._turn_on_bench(sample, dt)
        elif self.mode not in FLYING or self.control_mode is ControlMode.EMERGENCY:
            self._rest()
        elif self.behaviors.name is BehaviorName.GROUND:
            self._idle()
            command = self._references() if self.mode in FLYING else None
        else:
            command = self._fly(dt, airborne)
        self._write_status(sample, pose_age)
        return command

    def _fly(self, dt: float, airborne: bool) -> tuple[int, int, int, int]:
        """Fly the behavior's reference, and return the command that holds it."""
        behaviors = self.behaviors
        behaviors.step(
            self._stamp_ns,
            dt,
            self.state,
            self._joy,
            airborne,
            self._wrench.item(0),
            self.reference,
        )
        level = behaviors.level
        self.steer_by(ControlMode.DIRECT if level is None else ControlMode.NEAR_HOVERING)
        if level is None:
            self.steering.controller.step(self.state, self.reference, airborne, dt, self.actuators)
            self.near_hovering.observe(self._wrench.item(0), dt)
            command = self._references()
        else:
            command = self._level(level, dt)
        if behaviors.aborted:
            self.say(f"braking: {behaviors.aborted}", mailbox.WARN)
            behaviors.aborted = ""
        self._watch_ground(dt)
        return command

    def _level(self, level: Level, dt: float) -> tuple[int, int, int, int]:
        """Return a command to the microcontroller, which holds the angles."""
        self.actuators[...] = self._off
        command, thrust = self.near_hovering.command(level, self.steering.mass, dt)
        self._wrench[0] = thrust
        return command

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
        elif isinstance(measurement, mailbox.ExternalReference):
            self.behaviors.outside.take(measurement.stamp_ns, measurement.numbers)
        elif isinstance(measurement, mailbox.Heartbeat):
            self.supervisor.heard(measurement.stamp_ns)

    def loop_statistics(
        self, statistics: LoopStatistics, counts: LoopCounts, rate: float, real_time: bool
    ) -> None:
        """Take over what the loop measured of itself: over the last second, and since its start.

        Args: `rate` in Hz, as it is meant to be.
        """
        self._status_writer.loop(statistics, counts, rate)
        self._status_writer.real_time = real_time

    def configure(self) -> None:
        """Hand the present parameters to every part; called at a tick boundary."""
        p = self.parameters
        self.mass.follow(p.mass, p.model.mass, self.mode in FLYING)
        self.steering.configure(p.control, p.model)
        self._fly_on(self.mass.mass if self.mass.used else p.model.mass)
        self.behaviors.model = self.steering.model
        if p.beacons.layout != self._layout:
            self._layout = p.beacons.layout
            self.navigation.place(parse_layout(self._layout))
        self.navigation.configure(p.estimation)
        self.guard.configure()
        self._pose_timeout = p.estimation.measurement_timeout
        self.imu_calibrator.configure(p.imu)
        self.status["parameter_revision"] = self.store.revision
        self.behaviors.control = p.control

    # ------------------------------------------------------------------ parts of the tick
    def _weighs(self, airborne: bool) -> bool:
        """Return whether the commanded thrust alone carries the vehicle, as the mass estimate
        requires.

        An estimate that is only shown goes by the ground alone.
        """
        if not self.mass.used:
            return airborne
        if self.control_mode is not ControlMode.DIRECT:  # thrusts are the microcontroller's own
            return False
        return airborne and not (self.ground.carried and self.behaviors.name in LANDING)

    def _observe(self, airborne: bool, dt: float) -> None:
        """Observe disturbances, by what the law itself commanded; the ground's reaction is none."""
        flying = airborne and self.control_mode is ControlMode.DIRECT and self.mode in FLYING
        carried = self.ground.carried > 0.0 and self.behaviors.name in LANDING
        self.steering.observe(self.state, self.actuators, flying, carried, dt)

    def _fly_on(self, mass: float) -> None:
        """Set one mass (kg) for law, feed-forward and touch-down."""
        self.steering.weigh(mass)
        self.behaviors.hover_thrust = mass * GRAVITY

    def _advance_time(self, stamp_ns: int) -> float:
        dt = (stamp_ns - self._stamp_ns) * 1e-9 if self._stamp_ns else NOMINAL_STEP
        if dt <= 0.0:
            return 0.0
        self._stamp_ns = stamp_ns
        self._sequence[0] += 1
        return min(dt, LONGEST_GAP)

    def _follow_altitude(self, sample: RawSample, dt: float) -> None:
        """Follow the altitude by the barometer, in every mode: it may be needed at any time."""
        altitude = self.near_hovering.altitude
        if self.ground.airborne:
            altitude.step(sample.pressure, self._specific_force.item(2), dt)
        else:
            altitude.stand(sample.pressure, dt)

    def _look(self, sample: RawSample, pose_age: float) -> Situation:
        """Return what the supervisor is to know of this tick."""
        now, p = self._situation, self.parameters.behavior
        now.airborne = self.ground.airborne
        now.by_microcontroller = self.control_mode is not ControlMode.DIRECT
        now.voltage, now.pose_age, now.tilt = sample.battery_voltage, pose_age, self.tilt
        x, y, z = self._innovation.tolist()
        now.innovation = math.sqrt(x * x + y * y + z * z)
        now.jumped = self._agreement.item() == Agreement.JUMPED
        x, y, z = self._velocity.tolist()
        now.speed = math.sqrt(x * x + y * y + z * z)
        x, y, z = self._position.tolist()
        now.outside = max(
            p.volume_x_min - x,
            x - p.volume_x_max,
            p.volume_y_min - y,
            y - p.volume_y_max,
            z - p.volume_z_max,
        )
        now.saturated = self._scaling.item() < 1.0
        now.lost_ports = self.lost_ports
        return now

    def _watch_ground(self, dt: float) -> None:
        ground, p = self.ground, self.parameters
        landing = self.behaviors.name in LANDING
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
        """Idle armed on the ground: motors turn slowly, the reference follows the state."""
        stand(self.state, self.reference)
        self.controller.idle(self.actuators)
        if self.ground.rested(self._stamp_ns) >= self.parameters.safety.disarm_after_landing:
            self.move(Mode.READY, "landed")

    def _references(self) -> tuple[int, int, int, int]:
        return self._rounding.round(self._wanted_references)

    def _write_status(self, sample: RawSample, pose_age: float) -> None:
        # An emergency is told once the microcontroller shows it: people wait for that.
        if self.control_mode is not ControlMode.EMERGENCY or sample.motor_state != MotorState.ON:
            self._told_control_mode = self.control_mode
        navigation = self.navigation
        self._status_writer.write(
            mode=self.mode,
            control_mode=self._told_control_mode,
            behavior=self.behaviors.name,
            airborne=self.ground.airborne,
            supervisor_flags=self.supervisor.flags,
            estimate_flags=self.guard.flags | navigation.agreement.flags | navigation.suspect.flags,
            suspect=navigation.suspect.status,
            stale_pose=pose_age > self._pose_timeout,
            saturated=self._scaling.item() < 1.0,
            tilt_limited=self.controller.tilt_limited,
            voltage=sample.battery_voltage,
            pressure=sample.pressure,
        )
