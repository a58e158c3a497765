"""One vehicle's flight stack: the whole tick on one screen.

Data flows one way: sample -> estimator -> state -> supervisor -> behavior -> reference ->
controller -> thrusts -> command for the board. The tick is clocked by the stamps of the IMU and
never reads a clock, so the same code flies in real time, faster, and in replay, with identical
results for identical input. Only the caller's thread may use it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from control.behaviors.table import BehaviorName
from estimation.estimator import Estimator
from estimation.outcome import Agreement
from quadrotor.records import POSE_SAMPLE, Record
from vehicle import mailbox
from vehicle.boards.board import Command, RawSample, Traits
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.estimators.repeated_poses import RepeatedPoses
from vehicle.flight.microcontroller_commands import command_maker
from vehicle.flight.stack_parts import StackParts
from vehicle.modes import BENCH, DIRECT, EMERGENCY, FLYING, STARTING, ControlMode, Mode
from vehicle.parameters import VehicleParameters

_GROUND, _EXTERNAL = BehaviorName.GROUND, BehaviorName.EXTERNAL
_DESCENT, _USED = BehaviorName.EMERGENCY_LANDING, int(Agreement.USED)
LONGEST_STEP = 0.05
"""Longest step, in s, of laws and behaviors, also after a longer gap between samples."""
TOLD_GAP, TOLD_EVERY_NS = 0.1, 10_000_000_000
"""Gap between samples in flight, in s, that an event tells, and the least time between two."""


class FlightStack:
    """The vehicle's flight code: one IMU sample in, a command for the board out.

    Attributes:
        record, state, reference, estimate, status: TICK (1,), filled by each tick, and its fields.
        outbox: messages for other processes; the caller empties the list.
        store: the vehicle's parameters, for reading.
        say: adds a line, and its level, for the log and the page.
        handle: carries out or refuses a command; the reply gives the reason.
        loop_statistics: stores the statistics of the loop.
        link_statistics: stores those of the link to the board.

    Args:
        parameters: the vehicle's parameter tree; this stack becomes its only writer.
        estimator: any object with the protocol's methods; the default is the estimator that the
            parameters name.
        plugins: folder of users' control laws and estimators; may be missing.
        waits: whether simulated time waits for the answers of those.
        board: traits of the board that receives the commands; None for the MikroKopter's.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        estimator: Estimator | None = None,
        plugins: Path | None = None,
        waits: bool = True,
        board: Traits | None = None,
    ) -> None:
        board = board or find_kind(MIKROKOPTER).traits
        parts = StackParts(parameters, estimator, plugins, waits, board)
        tick = self._tick = parts.tick
        self.parameters, self.law, self.mass = parameters, parts.law, parts.mass
        self.record, self.state, self.reference = tick.record, tick.state, tick.reference
        self.estimate, self.status = tick.estimate, tick.status
        self.outbox, self.say = parts.outbox.messages, parts.outbox.say
        self.behaviors, self.own_behaviors = parts.behaviors, parts.own_behaviors
        self.imu_calibrator, self.own_sensors = parts.imu_calibrator, parts.own_sensors
        self.near_hovering, self.bench = parts.near_hovering, parts.bench
        self.ground, self.supervisor = parts.ground, parts.supervisor
        self.navigation, self.integrity = parts.navigation, parts.integrity
        self.modes, self.gyroscope, self.model = parts.modes, parts.gyroscope, parts.model
        self.store, self.handle = parts.configuration.store, parts.commands.handle
        self._say_braking = parts.outbox.say_braking
        self._repeats = RepeatedPoses(self.say)
        self._changes, self._landing = parts.changes, parts.landing
        self._situation, self._bounds = parts.situation, parts.bounds
        self._status_writer = parts.status_writer
        self.loop_statistics, self.link_statistics = (
            parts.status_writer.loop,
            parts.status_writer.link,
        )
        self._make_command = command_maker(board, tick, self.law)
        self._joy: tuple[int, tuple[float, float, float, float], bool] | None = None
        self._gap_told_ns = -TOLD_EVERY_NS

    # ------------------------------------------------------------------ the tick
    def tick(self, sample: RawSample) -> Command | None:
        """Process one IMU sample; return the command for the board, None if there is none."""
        since = self._tick.begin(sample.stamp_ns)
        if since <= 0.0:
            return None
        dt = min(since, LONGEST_STEP)
        modes, tick = self.modes, self._tick
        if since > TOLD_GAP and modes.mode in FLYING:
            self._tell_gap(since)
        self.imu_calibrator.calibrate(sample, tick.imu)
        self.integrity.note(tick.imu, tick.actuators, self.law.model, sample.pressure)
        if modes.mode is STARTING:
            self.gyroscope.step(sample)

        airborne = self.ground.airborne
        self.navigation.step(tick.imu, since, tick.state, tick.estimate)
        if self.own_sensors.externals:
            flying, now_ns, navigation = modes.mode in FLYING, tick.stamp_ns, self.navigation
            self.own_sensors.step(
                now_ns, since, tick.imu, tick.state, sample.pressure, flying, navigation=navigation
            )
            self._changes.check_sensors()
        self._changes.check_estimators()
        self.model.step(sample, since, dt)
        pose_age = self.navigation.measurement_age(self._tick.stamp_ns)
        self._follow_altitude(sample, since)
        verdict = self.supervisor.step(self._tick.stamp_ns, self._situation.read(sample, pose_age))
        if verdict is not None and modes.mode in FLYING:
            modes.react(verdict)
        self._changes.check_bearings()
        if self.integrity.contradiction and modes.mode is Mode.ARMED:
            self._landing.abort_take_off(self.integrity.contradiction)
        if modes.mode in FLYING:
            modes.follow_motor_state(sample)
        self._changes.check_law()
        self._changes.check_behavior()

        command: Command | None = None
        if modes.mode is BENCH:
            command = modes.step_bench(sample, dt)
        elif modes.mode not in FLYING or modes.control_mode is EMERGENCY:
            tick.rest()
        elif self.behaviors.name is _GROUND:
            self._landing.idle()
            command = self._make_command() if modes.mode in FLYING else None
        else:
            command = self._fly(dt, airborne)
        self._bounds.step(tick.stamp_ns, airborne and modes.control_mode is DIRECT)
        self._changes.check_oscillation(airborne, dt)
        self._status_writer.write(sample, pose_age)
        return command

    def _fly(self, dt: float, airborne: bool) -> Command:
        """Step the behavior's reference and return the command that follows it."""
        behaviors, tick = self.behaviors, self._tick
        command: Command
        is_external = behaviors.name is _EXTERNAL
        own = self.own_behaviors.external if is_external else None
        if own is not None:
            timeout = self.parameters.behavior.joy_timeout
            own.step(tick.stamp_ns, dt, tick.state, tick.reference, self._joy, timeout)
        behaviors.step(
            self._tick.stamp_ns, dt, tick.state, self._joy, tick.wrench.item(0), tick.reference
        )
        level = behaviors.level
        if level is None:
            self.modes.set_control_mode(DIRECT)
            self.law.controller.step(tick.state, tick.reference, airborne, dt, tick.actuators)
            self.near_hovering.observe(tick.wrench.item(0), dt)
            command = self._make_command()
        else:  # the board holds the angles itself
            self.modes.set_control_mode(ControlMode.NEAR_HOVERING)
            tick.motors_off()
            attitude = self.near_hovering.command(level, self.law, dt, behaviors.unloading)
            tick.wrench[0] = attitude.thrust
            command = attitude
        if behaviors.aborted:
            why = behaviors.pop_aborted()
            self._say_braking(why)
            if own is not None:
                own.failure = own.failure or why
        self._landing.watch(dt)
        return command

    # ------------------------------------------------------------------ inputs between ticks
    def measure(self, measurement: mailbox.Measurement | Record) -> None:
        """Process one message, POSE_SAMPLE or BEARINGS_SAMPLE (1,), which acts at the next tick."""
        if isinstance(measurement, np.ndarray):
            if measurement.dtype != POSE_SAMPLE or self._takes(measurement):
                self.navigation.measure(measurement)
        elif isinstance(measurement, mailbox.Joy):
            self._joy = (measurement.stamp_ns, measurement.axes, measurement.enabled)
        elif isinstance(measurement, mailbox.ExternalReference):
            if self.own_behaviors.external is None:
                self.behaviors.outside.store(measurement.stamp_ns, measurement.numbers)
        elif isinstance(measurement, mailbox.Heartbeat):
            self.supervisor.heartbeat(measurement.stamp_ns)

    def close(self) -> None:
        """End the processes of plugins."""
        self.law.close()
        self.own_behaviors.close()
        self.own_sensors.close()
        self.navigation.close()

    # ------------------------------------------------------------------ outputs
    @property
    def mode(self) -> Mode:
        """Return the mode of the vehicle as a whole."""
        return self.modes.mode

    @property
    def readings(self) -> list[Record]:
        """Return the newest tick's readings of the user's own sensors, JUDGED_READING (1,) each."""
        return self.own_sensors.judged() if self.own_sensors.externals else []

    @property
    def stamp_ns(self) -> int:
        """Return the time of the newest tick, ns of the vehicle's clock."""
        return self._tick.stamp_ns

    @property
    def estimator(self) -> Estimator:
        """Return the estimator in use."""
        return self.navigation.active

    # ------------------------------------------------------------------ parts of the tick
    def _takes(self, pose: Record) -> bool:
        """Return whether a POSE_SAMPLE (1,) is a measurement and no lie of the tracker."""
        if not self._repeats.takes(pose, self.state, self.ground.airborne):
            return False
        if self.modes.mode is STARTING:  # without the gyroscope's bias
            self.integrity.begin()
            return True
        vehicle = self.parameters.estimation.tracker.measured(pose)
        return self.integrity.takes(vehicle, self.state, self.modes.mode in FLYING)

    def _tell_gap(self, seconds: float) -> None:
        """Report that no samples came for this time."""
        if self.stamp_ns - self._gap_told_ns >= TOLD_EVERY_NS:
            self._gap_told_ns = self.stamp_ns
            line = f"the board sent no samples for {seconds:.2f} s in flight: check its connection"
            self.say(line, mailbox.WARN)

    def _follow_altitude(self, sample: RawSample, dt: float) -> None:
        """Estimate the altitude by the barometer in every mode, as it may be needed at any time."""
        altitude, descent = self.near_hovering.altitude, self.near_hovering.descent
        if not self.ground.airborne:
            altitude.set_ground(sample.pressure, dt)
            descent.rest()
            return
        tick, lift = self._tick, self._tick.specific_force_b.item(2)
        altitude.step(sample.pressure, lift, dt)
        if self.integrity.contradiction or self.integrity.suspicion:
            descent.distrust_accelerometer()
        if self.behaviors.name is _DESCENT:
            descent.watch(lift, self.parameters.behavior.emergency_landing_speed, dt)
        else:
            is_known = self.navigation.has_pose and tick.agreement.item() == _USED
            height = tick.position_w.item(2) - self.ground.ground_z
            motion = (height, tick.state["velocity_w"].item(2)) if is_known else None
            descent.follow(tick.vertical_force, motion, dt)
