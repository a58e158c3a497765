"""One vehicle's flight stack: the whole tick on one screen.

Data flows one way: sample -> estimator -> state -> supervisor -> behavior -> reference ->
controller -> thrusts -> command for the board. The tick is clocked by the stamps of the IMU and
never reads a clock, so the same code flies in real time, faster, and in replay, with identical
results for identical input. Only the caller's thread may use it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bearing_sim.beacons import parse_layout
from control.behaviors.ground import stand
from control.behaviors.machine import BehaviorMachine
from control.behaviors.near_hovering import Level
from control.behaviors.parameters import NONE as NO_PLUGIN
from control.behaviors.table import BehaviorName
from control.controller import Controller
from control.parameters import GEOMETRIC, NONE
from estimation.estimator import Estimator
from quadrotor.parameters import ParameterStore
from quadrotor.records import Record
from vehicle.behaviors.behaviors import PARAMETER, OwnBehaviors
from vehicle.behaviors.external import ExternalBehavior
from vehicle.boards.board import Command, RawSample, Takes, Traits
from vehicle.boards.mikrokopter.microcontroller import TRAITS
from vehicle.calibration.imu import ImuCalibrator
from vehicle.estimators.bearings_guard import BearingsGuard, WayBack
from vehicle.estimators.estimators import Estimators
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.rescue import Rescue
from vehicle.flight.commands import CommandHandler
from vehicle.flight.configuration import Configuration
from vehicle.flight.control_law import Steering
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.gyroscope import GyroscopeStart
from vehicle.flight.lateness import LoopCounts, LoopStatistics
from vehicle.flight.law_end import law_end
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import LANDING, ModelInUse
from vehicle.flight.modes import FLYING, ControlMode, Mode
from vehicle.flight.motor_bench import Bench
from vehicle.flight.near_hovering import NearHovering
from vehicle.flight.outbox import Outbox
from vehicle.flight.situation import SituationReader
from vehicle.flight.status_writer import StatusWriter
from vehicle.flight.tick_record import TickRecord
from vehicle.laws.external import ExternalLaw
from vehicle.laws.laws import LAW, SHADOW_LAW, Laws
from vehicle.parameters import VehicleParameters
from vehicle.processes import mailbox
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.supervisor import Supervisor

LONGEST_STEP = 0.05
"""Longest step, in s, of laws and behaviors, also after a longer gap between samples."""


class FlightStack:
    """The vehicle's flight code: one IMU sample in, a command for the board out.

    Args:
        parameters: the vehicle's parameter tree; this stack becomes its only writer.
        estimator, controller: plugins, any object with the protocol's methods; defaults are the
            estimator and the law that the parameters name.
        plugins: folder of users' control laws and estimators; may be missing.
        waits: whether simulated time waits for the answers of those.
        board: traits of the board that receives the commands.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        estimator: Estimator | None = None,
        controller: Controller | None = None,
        plugins: Path | None = None,
        waits: bool = True,
        board: Traits = TRAITS,
    ) -> None:
        p = self.parameters = parameters
        tick = self._tick = TickRecord()
        outbox = self._outbox = Outbox(tick)
        self.steering = Steering(p.control, p.model, controller, Laws(plugins, waits))
        self.mass = FlownMass(p.mass, p.model.mass)
        self.behaviors = BehaviorMachine(p.behavior)
        self.own_behaviors = OwnBehaviors(plugins, waits, self.behaviors.outside, p.behavior.plugin)
        self.supervisor = Supervisor(p.safety)
        self.imu_calibrator = ImuCalibrator(p.imu)
        self.near_hovering = NearHovering(p.near_hovering)
        self.ground = GroundContact()
        self.bench = Bench(p.safety, board.missing(Takes.MOTORS))
        beacons = parse_layout(p.beacons.layout)
        estimators = Estimators(plugins, waits)
        self.navigation = Navigation(
            p.estimation, outbox.say, estimator, beacons, p.fallback, estimators
        )
        self.guard = BearingsGuard(p, tick.state, self.navigation, self.behaviors, self.ground)
        self.rescue = Rescue(p.estimation, self.navigation, tick.state)
        self.modes = ModeMachine(
            safety=p.safety,
            tick=tick,
            outbox=outbox,
            behaviors=self.behaviors,
            steering=self.steering,
            navigation=self.navigation,
            ground=self.ground,
            supervisor=self.supervisor,
            mass=self.mass,
            guard=self.guard,
            bench=self.bench,
            tells_pressure=board.tells_pressure,
        )
        self.gyroscope = GyroscopeStart(
            safety=p.safety,
            tick=tick,
            outbox=outbox,
            modes=self.modes,
            imu_calibrator=self.imu_calibrator,
            navigation=self.navigation,
        )
        self.model = ModelInUse(
            tick=tick,
            modes=self.modes,
            ground=self.ground,
            steering=self.steering,
            mass=self.mass,
            behaviors=self.behaviors,
        )
        self.configuration = Configuration(
            p,
            tick=tick,
            outbox=outbox,
            modes=self.modes,
            ground=self.ground,
            model=self.model,
            steering=self.steering,
            mass=self.mass,
            behaviors=self.behaviors,
            own_behaviors=self.own_behaviors,
            navigation=self.navigation,
            guard=self.guard,
            imu_calibrator=self.imu_calibrator,
        )
        self.commands = CommandHandler(
            p,
            configuration=self.configuration,
            tick=tick,
            outbox=outbox,
            modes=self.modes,
            gyroscope=self.gyroscope,
            bench=self.bench,
            behaviors=self.behaviors,
            own_behaviors=self.own_behaviors,
            navigation=self.navigation,
            guard=self.guard,
            supervisor=self.supervisor,
            ground=self.ground,
        )
        self._law_end = law_end(board.direct, self._tick, self.steering)
        self._situation = SituationReader(
            volume=p.behavior, tick=tick, modes=self.modes, ground=self.ground
        )
        self._status_writer = StatusWriter(
            estimation=p.estimation,
            tick=tick,
            modes=self.modes,
            behaviors=self.behaviors,
            navigation=self.navigation,
            steering=self.steering,
            supervisor=self.supervisor,
            guard=self.guard,
            rescue=self.rescue,
            ground=self.ground,
        )
        self._joy: tuple[int, tuple[float, float, float, float], bool] | None = None

    # ------------------------------------------------------------------ the tick
    def tick(self, sample: RawSample) -> Command | None:
        """Process one IMU sample; return the command for the board, None if there is none."""
        since = self._tick.begin(sample.stamp_ns)
        if since <= 0.0:
            return None
        dt = min(since, LONGEST_STEP)
        modes, tick = self.modes, self._tick
        self.imu_calibrator.calibrate(sample, tick.imu)
        if modes.mode is Mode.STARTING:
            self.gyroscope.step(sample)

        airborne = self.ground.airborne
        self.navigation.step(tick.imu, since, tick.state, tick.estimate)
        if self.navigation.externals:
            self._tell_of_estimators()
        if self.navigation.measured or self.navigation.externals:
            self._rescue()
        self.model.step(sample, since, dt)
        pose_age = self.navigation.measurement_age(self._tick.stamp_ns)
        self._follow_altitude(sample, since)
        verdict = self.supervisor.step(self._tick.stamp_ns, self._situation.read(sample, pose_age))
        if verdict is not None and modes.mode in FLYING:
            modes.react(verdict)
        if self.guard.on:
            self._end_bearings(self.guard.step(armed=modes.mode is Mode.ARMED))
        if modes.mode in FLYING:
            modes.heed(sample)

        if self.steering.external is not None:
            self._watch_law(self.steering.external)
        if self.own_behaviors.external is not None:
            self._watch_behavior(self.own_behaviors.external)

        command: Command | None = None
        if modes.mode is Mode.BENCH:
            command = self._turn_on_bench(sample, dt)
        elif modes.mode not in FLYING or modes.control_mode is ControlMode.EMERGENCY:
            tick.rest()
        elif self.behaviors.name is BehaviorName.GROUND:
            self._idle()
            command = self._law_end() if modes.mode in FLYING else None
        else:
            command = self._fly(dt, airborne)
        self._status_writer.write(sample, pose_age)
        return command

    def _fly(self, dt: float, airborne: bool) -> Command:
        """Step the behavior's reference and return the command that follows it."""
        behaviors, tick = self.behaviors, self._tick
        is_external = behaviors.name is BehaviorName.EXTERNAL
        own = self.own_behaviors.external if is_external else None
        if own is not None:
            own.step(
                tick.stamp_ns,
                dt,
                tick.state,
                tick.reference,
                self._joy,
                self.parameters.behavior.joy_timeout,
            )
        behaviors.step(
            self._tick.stamp_ns,
            dt,
            tick.state,
            self._joy,
            airborne,
            tick.wrench.item(0),
            tick.reference,
        )
        level = behaviors.level
        self.modes.steer_by(ControlMode.DIRECT if level is None else ControlMode.NEAR_HOVERING)
        if level is None:
            self.controller.step(tick.state, tick.reference, airborne, dt, tick.actuators)
            self.near_hovering.observe(tick.wrench.item(0), dt)
            command = self._law_end()
        else:
            command = self._level(level, dt)
        if behaviors.aborted:
            why = behaviors.pop_aborted()
            self.say(f"braking: {why}", mailbox.WARN)
            if own is not None:
                own.failure = own.failure or why
        self._watch_ground(dt)
        return command

    def _level(self, level: Level, dt: float) -> Command:
        """Return a command for the board to hold the angles itself."""
        self._tick.motors_off()
        command = self.near_hovering.command(level, self.steering, dt)
        self._tick.wrench[0] = command.thrust
        return command

    def _turn_on_bench(self, sample: RawSample, dt: float) -> tuple[int, int, int, int] | None:
        """Return the references of one tick in mode BENCH, None when the test is over."""
        bench, modes, tick = self.bench, self.modes, self._tick
        why = bench.fault(
            sample, self.supervisor.battery_spent, modes.motors_had_time, modes.obstacle
        ) or bench.over(self._tick.stamp_ns, tick.angular_velocity_b, dt)
        if why:
            modes.move(Mode.READY, f"{bench} stopped: {why}", mailbox.WARN)
            tick.rest()
            return None
        tick.rest()
        tick.motor_references[bench.motor - 1] = bench.reference
        return bench.references

    # ------------------------------------------------------------------ inputs between ticks
    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        """Carry out or refuse one command; the reply gives the reason."""
        return self.commands.handle(command)

    def measure(self, measurement: mailbox.Measurement | Record) -> None:
        """Process one message, POSE_SAMPLE or BEARINGS_SAMPLE (1,), which acts at the next tick."""
        if isinstance(measurement, np.ndarray):
            self.navigation.measure(measurement)
        elif isinstance(measurement, mailbox.Joy):
            self._joy = (measurement.stamp_ns, measurement.axes, measurement.enabled)
        elif isinstance(measurement, mailbox.ExternalReference):
            if self.own_behaviors.external is None:
                self.behaviors.outside.take(measurement.stamp_ns, measurement.numbers)
        elif isinstance(measurement, mailbox.Heartbeat):
            self.supervisor.heartbeat(measurement.stamp_ns)

    def loop_statistics(
        self, statistics: LoopStatistics, counts: LoopCounts, rate: float, real_time: bool
    ) -> None:
        """Store the loop's statistics over the last second, and since its start.

        Args:
            rate: nominal rate, Hz.
        """
        self._status_writer.loop(statistics, counts, rate, real_time)

    def say(self, text: str, level: int = mailbox.INFO) -> None:
        """Add a line for the log and the page."""
        self._outbox.say(text, level)

    def close(self) -> None:
        """End the processes of plugins."""
        self.steering.close()
        self.own_behaviors.close()
        self.navigation.close()

    # ------------------------------------------------------------------ outputs
    @property
    def record(self) -> Record:
        """Return TICK (1,), filled by each tick."""
        return self._tick.record

    @property
    def state(self) -> Record:
        """Return STATE (1,) of the record."""
        return self._tick.state

    @property
    def reference(self) -> Record:
        """Return REFERENCE (1,) of the record."""
        return self._tick.reference

    @property
    def estimate(self) -> Record:
        """Return ESTIMATE (1,) of the record."""
        return self._tick.estimate

    @property
    def status(self) -> Record:
        """Return STATUS (1,) of the record."""
        return self._tick.status

    @property
    def outbox(self) -> list[mailbox.Told]:
        """Return the messages for other processes; the caller empties the list."""
        return self._outbox.messages

    @property
    def store(self) -> ParameterStore:
        """Return the store of the vehicle's parameters, for reading."""
        return self.configuration.store

    @property
    def mode(self) -> Mode:
        """Return the mode of the vehicle as a whole."""
        return self.modes.mode

    @property
    def airborne(self) -> bool:
        """Return whether the vehicle is between take-off and touch-down."""
        return self.ground.airborne

    @property
    def stamp_ns(self) -> int:
        """Return the time of the newest tick, ns of the vehicle's clock."""
        return self._tick.stamp_ns

    @property
    def estimator(self) -> Estimator:
        """Return the estimator in use."""
        return self.navigation.active

    @property
    def controller(self) -> Controller:
        """Return the controller in use."""
        return self.steering.controller

    # ------------------------------------------------------------------ parts of the tick
    def _end_bearings(self, way: WayBack | None) -> None:
        """End a flight on bearings as the guard requested."""
        if way is None:
            return
        if way.values:
            self.say(way.why, way.level)
            self.configuration.apply(way.values, "vehicle")
        else:
            self.modes.land(way.why)

    def _rescue(self) -> None:
        """Change to the shadow estimator, or back from it, when that is due."""
        change = self.rescue.look(self._tick.stamp_ns)
        if change is None:
            return
        self.say(change.why, change.level)
        self.configuration.apply(change.values, "vehicle")
        self.navigation.take_over(self._tick.state)

    def _tell_of_estimators(self) -> None:
        for external in self.navigation.externals:
            for line in external.news(self.modes.mode in FLYING):
                self.say(line)

    def _watch_law(self, law: ExternalLaw) -> None:
        """Report when an external law is ready; disable one that failed.

        In the tick of the failure the built-in law has already taken over.
        """
        if law.becomes_ready():
            self.say(f"law {law.name} is ready")
        if law.ticks and self.modes.mode not in FLYING:
            self.say(law.summary())
        if not law.failure:
            return
        flies = "took over" if law.flown else "flies on"
        self.say(f"law {law.name} disengaged, {GEOMETRIC} {flies}: {law.failure}", mailbox.WARN)
        self.configuration.apply({LAW: GEOMETRIC, SHADOW_LAW: NONE}, "vehicle")

    def _watch_behavior(self, behavior: ExternalBehavior) -> None:
        """Report when a behavior of the user's own is ready; disable one that failed.

        In the tick of the failure the vehicle has already begun to brake.
        """
        if behavior.becomes_ready():
            self.say(f"behavior {behavior.name} is ready")
        if behavior.ticks and self.modes.mode not in FLYING:
            self.say(behavior.summary())
        if behavior.failure:
            self.say(f"behavior {behavior.name} disengaged: {behavior.failure}", mailbox.WARN)
            self.configuration.apply({PARAMETER: NO_PLUGIN}, "vehicle")

    def _follow_altitude(self, sample: RawSample, dt: float) -> None:
        """Estimate the altitude by the barometer in every mode, as it may be needed at any time."""
        altitude = self.near_hovering.altitude
        if self.ground.airborne:
            altitude.step(sample.pressure, self._tick.specific_force_b.item(2), dt)
        else:
            altitude.stand(sample.pressure, dt)

    def _watch_ground(self, dt: float) -> None:
        ground, p = self.ground, self.parameters
        landing = self.behaviors.name in LANDING
        if ground.airborne:
            ground.feel(
                self._tick.specific_force_b.item(2),
                self._tick.wrench.item(0),
                p.safety.landing_support,
                dt,
            )
        elif not landing:
            ground.rise(float(self._tick.state["position_w"][0, 2]))
        carried = landing and ground.carried >= p.behavior.landing_dwell
        if (carried or self.behaviors.landed) and ground.touch_down(self._tick.stamp_ns):
            self.behaviors.reset()
            self.controller.reset()
            self.say("touched down")

    def _idle(self) -> None:
        """Idle while armed on the ground: motors turn slowly, the reference follows the state."""
        stand(self._tick.state, self._tick.reference)
        self.controller.idle(self._tick.actuators)
        if self.ground.rested(self._tick.stamp_ns) >= self.parameters.safety.disarm_after_landing:
            self.modes.move(Mode.READY, "landed")
