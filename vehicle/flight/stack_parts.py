"""The parts of the flight stack, and what each is made from.

Each part is made when another one, or the stack, first needs it, so that the order of their
construction follows from what they name.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path

from bearing_sim.beacons import parse_layout
from control.behaviors.machine import BehaviorMachine
from estimation.estimator import Estimator
from vehicle import mailbox
from vehicle.behaviors.behaviors import OwnBehaviors
from vehicle.boards.board import CommandKind, Traits
from vehicle.boards.imu import ImuCalibrator
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.estimators import Estimators
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.rescue import Rescue
from vehicle.estimators.tracker_integrity import TrackerIntegrity
from vehicle.flight.automatic_changes import AutomaticChanges
from vehicle.flight.bounds_watch import BoundsWatch
from vehicle.flight.commands import CommandHandler
from vehicle.flight.configuration import Configuration
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.gyroscope import GyroscopeStart
from vehicle.flight.landing import Landing
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import ModelInUse
from vehicle.flight.motor_bench import Bench
from vehicle.flight.near_hovering import NearHovering
from vehicle.flight.situation import SituationReader
from vehicle.flight.status_writer import StatusWriter
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.laws.laws import Laws
from vehicle.parameters import VehicleParameters
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.oscillation import OscillationWatch
from vehicle.safety.supervisor import Supervisor
from vehicle.sensors.sensors import OwnSensors


@dataclass
class StackParts:
    """The parts of one flight stack.

    Attributes:
        parameters: the vehicle's parameter tree; the stack becomes its only writer.
        estimator: any object with the protocol's methods; the default is the estimator that the
            parameters name.
        plugins: folder of users' control laws and estimators; may be missing.
        waits: whether simulated time waits for the answers of those.
        board: traits of the board that receives the commands.
    """

    parameters: VehicleParameters
    estimator: Estimator | None
    plugins: Path | None
    waits: bool
    board: Traits

    # ------------------------------------------------------------------ what a tick writes
    @cached_property
    def tick(self) -> TickRecord:
        return TickRecord()

    @cached_property
    def outbox(self) -> Outbox:
        return Outbox(self.tick)

    # ------------------------------------------------------------------ control and behaviors
    @cached_property
    def law(self) -> ControlLaw:
        laws = Laws(self.plugins, self.waits)
        return ControlLaw(self.parameters.control, self.parameters.model, laws)

    @cached_property
    def mass(self) -> FlownMass:
        return FlownMass(self.parameters.mass, self.parameters.model.mass)

    @cached_property
    def behaviors(self) -> BehaviorMachine:
        return BehaviorMachine(self.parameters.behavior)

    @cached_property
    def own_behaviors(self) -> OwnBehaviors:
        chosen = self.parameters.behavior.plugin
        return OwnBehaviors(self.plugins, self.waits, self.behaviors.outside, chosen)

    @cached_property
    def near_hovering(self) -> NearHovering:
        warn = partial(self.outbox.say, level=mailbox.WARN)
        return NearHovering(self.parameters.near_hovering, warn)

    @cached_property
    def bench(self) -> Bench:
        return Bench(self.parameters.safety, self.board.missing(CommandKind.MOTORS))

    # ------------------------------------------------------------------ sensors and estimate
    @cached_property
    def imu_calibrator(self) -> ImuCalibrator:
        return ImuCalibrator(self.parameters.imu)

    @cached_property
    def own_sensors(self) -> OwnSensors:
        return OwnSensors(self.plugins, self.waits, self.parameters.estimation.sensors)

    @cached_property
    def navigation(self) -> Navigation:
        p = self.parameters
        return Navigation(
            p.estimation,
            self.outbox.say,
            self.estimator,
            parse_layout(p.beacons.layout),
            p.fallback,
            Estimators(self.plugins, self.waits),
        )

    # ------------------------------------------------------------------ safety
    @cached_property
    def supervisor(self) -> Supervisor:
        return Supervisor(self.parameters.safety)

    @cached_property
    def ground(self) -> GroundContact:
        return GroundContact()

    @cached_property
    def integrity(self) -> TrackerIntegrity:
        return TrackerIntegrity(self.parameters.safety, self.outbox.say)

    @cached_property
    def guard(self) -> BearingsGuard:
        return BearingsGuard(
            self.parameters, self.tick.state, self.navigation, self.behaviors, self.ground
        )

    @cached_property
    def rescue(self) -> Rescue:
        return Rescue(self.parameters.estimation, self.navigation, self.tick.state)

    # ------------------------------------------------------------------ modes and commands
    @cached_property
    def modes(self) -> ModeMachine:
        return ModeMachine(
            safety=self.parameters.safety,
            tick=self.tick,
            outbox=self.outbox,
            behaviors=self.behaviors,
            law=self.law,
            navigation=self.navigation,
            ground=self.ground,
            supervisor=self.supervisor,
            mass=self.mass,
            guard=self.guard,
            bench=self.bench,
            reports_pressure=self.board.reports_pressure,
        )

    @cached_property
    def gyroscope(self) -> GyroscopeStart:
        return GyroscopeStart(
            safety=self.parameters.safety,
            tick=self.tick,
            outbox=self.outbox,
            modes=self.modes,
            imu_calibrator=self.imu_calibrator,
            navigation=self.navigation,
        )

    @cached_property
    def model(self) -> ModelInUse:
        return ModelInUse(
            tick=self.tick,
            modes=self.modes,
            ground=self.ground,
            law=self.law,
            mass=self.mass,
            behaviors=self.behaviors,
        )

    @cached_property
    def configuration(self) -> Configuration:
        return Configuration(
            parameters=self.parameters,
            tick=self.tick,
            outbox=self.outbox,
            modes=self.modes,
            ground=self.ground,
            model=self.model,
            law=self.law,
            mass=self.mass,
            behaviors=self.behaviors,
            own_behaviors=self.own_behaviors,
            own_sensors=self.own_sensors,
            navigation=self.navigation,
            guard=self.guard,
            imu_calibrator=self.imu_calibrator,
        )

    @cached_property
    def changes(self) -> AutomaticChanges:
        return AutomaticChanges(
            tick=self.tick,
            outbox=self.outbox,
            configuration=self.configuration,
            modes=self.modes,
            navigation=self.navigation,
            rescue=self.rescue,
            guard=self.guard,
            law=self.law,
            own_behaviors=self.own_behaviors,
            own_sensors=self.own_sensors,
            oscillation=self.oscillation,
            behaviors=self.behaviors,
        )

    @cached_property
    def commands(self) -> CommandHandler:
        return CommandHandler(
            parameters=self.parameters,
            configuration=self.configuration,
            tick=self.tick,
            outbox=self.outbox,
            modes=self.modes,
            gyroscope=self.gyroscope,
            bench=self.bench,
            behaviors=self.behaviors,
            own_behaviors=self.own_behaviors,
            navigation=self.navigation,
            integrity=self.integrity,
            guard=self.guard,
            supervisor=self.supervisor,
            ground=self.ground,
        )

    @cached_property
    def landing(self) -> Landing:
        return Landing(
            parameters=self.parameters,
            tick=self.tick,
            outbox=self.outbox,
            modes=self.modes,
            ground=self.ground,
            behaviors=self.behaviors,
            law=self.law,
            altitude=self.near_hovering.altitude,
        )

    @cached_property
    def situation(self) -> SituationReader:
        return SituationReader(
            volume=self.parameters.behavior,
            tick=self.tick,
            modes=self.modes,
            ground=self.ground,
            integrity=self.integrity,
        )

    @cached_property
    def oscillation(self) -> OscillationWatch:
        tick = self.tick
        return OscillationWatch(tick.state, tick.reference, self.outbox.say)

    @cached_property
    def bounds(self) -> BoundsWatch:
        return BoundsWatch(self.parameters, self.tick, self.law, self.outbox.say)

    @cached_property
    def status_writer(self) -> StatusWriter:
        return StatusWriter(
            estimation=self.parameters.estimation,
            tick=self.tick,
            modes=self.modes,
            behaviors=self.behaviors,
            navigation=self.navigation,
            law=self.law,
            supervisor=self.supervisor,
            guard=self.guard,
            rescue=self.rescue,
            integrity=self.integrity,
            ground=self.ground,
            bounds=self.bounds,
            oscillation=self.oscillation,
        )
