"""Commands to the vehicle: each is carried out whole or refused with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

from control.behaviors.machine import BehaviorMachine
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.behaviors.behaviors import OwnBehaviors
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.tracker_integrity import TrackerIntegrity
from vehicle.flight.configuration import Configuration
from vehicle.flight.gyroscope import GyroscopeStart
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.motor_bench import Bench, check_bench
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.modes import MOTORS_ON, Flag, Mode
from vehicle.parameters import VehicleParameters
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.supervisor import Supervisor
from vehicle_link.commands import EventKind

WITHOUT_A_POSE = ("near_hovering", "emergency_landing")
EXTERNAL = "external"
WITH_HEADING = ("follow_trajectory", "excite", EXTERNAL)
"""Behaviors that fly a plan; they are refused while the heading is unknown."""
SPOKEN = {"excite": "step test"}
"""Names of behaviors that events word otherwise."""


@dataclass(kw_only=True, eq=False)
class CommandHandler:
    """Handler of the commands to one flight stack, between two of its ticks."""

    parameters: VehicleParameters
    configuration: Configuration
    tick: TickRecord
    outbox: Outbox
    modes: ModeMachine
    gyroscope: GyroscopeStart
    bench: Bench
    behaviors: BehaviorMachine
    own_behaviors: OwnBehaviors
    navigation: Navigation
    integrity: TrackerIntegrity
    guard: BearingsGuard
    supervisor: Supervisor
    ground: GroundContact

    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        """Handle a command and return the reply.

        A refusal changes nothing and is logged with the requester.
        """
        applied: dict[str, ParameterValue] = {}
        previous: dict[str, ParameterValue] = {}
        try:
            if isinstance(command, mailbox.ChangeParameters):
                applied = self._change_parameters(command)
            elif isinstance(command, mailbox.Arm):
                self._arm(command.requester)
            elif isinstance(command, mailbox.Disarm):
                self._disarm(command.requester)
            elif isinstance(command, mailbox.ExpectMove):
                self._expect_move()
            elif isinstance(command, mailbox.StartBehavior):
                self._start_behavior(command)
            elif isinstance(command, mailbox.Emergency):
                self._emergency(command)
            elif isinstance(command, mailbox.Calibrate):
                applied, previous = self._calibrate(command)
            elif isinstance(command, mailbox.CalibrateGyroscope):
                self._require_rest("gyroscope not calibrated")
                self.gyroscope.begin(command)
            else:
                self._turn_motor(command)
        except QuadlabError as error:
            self.outbox.say(f"refused {command.requester}: {error}", mailbox.WARN, EventKind.ACT)
            kind = getattr(error, "kind", "")
            return mailbox.Reply(command.request_id, False, str(error), kind=kind)
        revision = self.configuration.store.revision
        return mailbox.Reply(command.request_id, True, "", applied, revision, previous)

    def _change_parameters(self, command: mailbox.ChangeParameters) -> dict[str, ParameterValue]:
        return self.configuration.apply(
            self.configuration.check(command.parameters), command.requester
        )

    def _calibrate(
        self, command: mailbox.Calibrate
    ) -> tuple[dict[str, ParameterValue], dict[str, ParameterValue]]:
        """Apply a calibration; return the values applied and those before."""
        self._require_rest("calibration not applied")
        configuration = self.configuration
        checked = configuration.check(command.values)
        before = {name: configuration.store.get(name) for name in checked}
        return configuration.apply(checked, command.requester), before

    def _turn_motor(self, command: mailbox.Bench) -> None:
        bench, modes, motor = self.bench, self.modes, command.motor
        if motor == 0:
            if modes.mode is Mode.BENCH:
                why = f"bench test of {bench} ended by {command.requester}"
                modes.move(Mode.READY, why, mailbox.INFO, EventKind.ACT)
            return  # nothing turns, as requested
        if bench.impossible:
            raise RefusedError(f"bench refused: {bench.impossible}")
        check_bench(motor, command.reference)
        if modes.mode is not Mode.BENCH:
            self._require_rest("bench refused")
            if not command.secured:
                raise RefusedError(
                    "bench refused: confirm first that the propellers are off or the vehicle is "
                    "fixed (secured)"
                )
            if modes.obstacle:
                raise RefusedError(f"bench refused: {modes.obstacle}")
            if self.supervisor.flags & Flag.BATTERY_LOW:
                raise RefusedError(f"bench refused: {self._low_battery()}")
        bench.turn(motor, command.reference, self.tick.stamp_ns)
        if modes.mode is not Mode.BENCH:
            modes.move(Mode.BENCH, f"{bench} by {command.requester}", mailbox.INFO, EventKind.ACT)

    def _expect_move(self) -> None:
        if self.modes.mode in MOTORS_ON:
            raise RefusedError("no move expected: the motors are on; disarm first")
        self.navigation.agreement.expect_move(self.tick.stamp_ns)
        self.integrity.begin()

    def _require_rest(self, refused: str) -> None:
        """Raise RefusedError unless the vehicle is on the ground with its motors off."""
        modes = self.modes
        if self.ground.airborne:
            why = "the vehicle is in flight; land and disarm first"
        elif modes.mode is Mode.STARTING:
            why = "the gyroscope is being calibrated; wait until it is, and keep the vehicle still"
        elif modes.mode is Mode.CUT:
            why = "the motors were cut; disarm first to acknowledge it"
        elif modes.mode is Mode.BENCH:
            why = f"motors are on: {self.bench} is on the bench; end it (motor 0) first"
        elif modes.mode is not Mode.READY:
            why = "motors are on; disarm first"
        else:
            return
        raise RefusedError(f"{refused}: {why}")

    def _low_battery(self) -> str:
        voltage = float(self.tick.status["battery_voltage"][0])
        return f"battery at {voltage:.1f} V, needs {self.parameters.safety.battery_warning:.1f} V"

    def _arm(self, requester: str) -> None:
        modes = self.modes
        if modes.mode is Mode.ARMED:
            raise RefusedError("already armed")
        if modes.mode is Mode.BENCH:
            raise RefusedError(f"not armed: {self.bench} is on the bench; end it first")
        if modes.mode is Mode.STARTING:
            raise RefusedError("not armed: the gyroscope is still being calibrated; keep it still")
        if modes.mode is Mode.CUT:
            raise RefusedError("not armed: the motors were cut; disarm first to acknowledge it")
        if modes.obstacle:
            raise RefusedError(f"not armed: {modes.obstacle}")
        self.integrity.check_arming()
        if not self.navigation.has_pose:
            raise RefusedError("not armed: no fresh pose measurement; check tracker and station")
        self.guard.check_take_off()
        flags = self.supervisor.flags
        if flags & Flag.LINK_LOST:
            raise RefusedError("not armed: no heartbeat from the station; check the link")
        if flags & Flag.BATTERY_LOW:
            raise RefusedError(f"not armed: {self._low_battery()}")
        tilt, limit = math.degrees(self.tick.tilt), self.parameters.safety.arm_tilt_max
        if tilt > limit:
            raise RefusedError(f"not armed: tilted by {tilt:.0f}°, allowed {limit:.0f}°")
        self.navigation.take_heading()
        modes.move(Mode.ARMED, f"requested by {requester}", mailbox.INFO, EventKind.ACT)

    def _disarm(self, requester: str) -> None:
        modes = self.modes
        if modes.mode in (Mode.STARTING, Mode.READY):
            raise RefusedError("the vehicle is not armed: there is nothing to disarm")
        if self.ground.airborne:
            raise RefusedError("not disarmed: the vehicle is flying; land first, or cut the motors")
        modes.move(Mode.READY, f"disarmed by {requester}", mailbox.INFO, EventKind.ACT)

    def _start_behavior(self, command: mailbox.StartBehavior) -> None:
        modes = self.modes
        if modes.mode is Mode.EMERGENCY_LAND:
            raise RefusedError(
                f"{command.name} refused: emergency landing; only cutting the motors is allowed"
            )
        if modes.mode is Mode.BENCH:
            raise RefusedError(
                f"{command.name} refused: {self.bench} is on the bench; end it, then arm"
            )
        held = self.behaviors.level is None
        if not held and not self.navigation.has_pose and command.name not in WITHOUT_A_POSE:
            raise RefusedError(
                f"{command.name} refused: no fresh pose measurement to hold position by; "
                f"possible now: {', '.join(WITHOUT_A_POSE)}"
            )
        heading = self.navigation.heading
        if heading.flags and command.name in WITH_HEADING:
            raise RefusedError(
                f"{command.name} refused: heading not observed, {heading.state}; "
                "fly back and forth, by fly_to or the sticks, first"
            )
        if command.name == EXTERNAL and self.own_behaviors.external is not None:
            self.own_behaviors.external.begin(self.tick.stamp_ns, self.tick.reference)
        self.behaviors.request(
            command.name,
            command.arguments,
            self.tick.state,
            armed=modes.mode is Mode.ARMED,
            airborne=self.ground.airborne,
        )
        self.outbox.say(
            f"{SPOKEN.get(command.name, command.name.replace('_', ' '))} by {command.requester}",
            mailbox.INFO,
            EventKind.ACT,
        )

    def _emergency(self, command: mailbox.Emergency) -> None:
        modes = self.modes
        if command.action not in ("land", "cut"):
            raise RefusedError(f"unknown emergency action {command.action!r}: use land or cut")
        if modes.mode in (Mode.STARTING, Mode.READY):
            raise RefusedError(f"emergency {command.action} refused: the motors are off")
        if command.action == "cut":
            if modes.mode is not Mode.CUT:
                modes.move(
                    Mode.CUT, f"emergency cut by {command.requester}", mailbox.ERROR, EventKind.ACT
                )
        elif modes.mode is Mode.BENCH or (modes.mode is Mode.ARMED and not self.ground.airborne):
            why = f"emergency land on the ground by {command.requester}"
            modes.move(Mode.READY, why, mailbox.INFO, EventKind.ACT)
        elif modes.mode is not Mode.CUT and self.ground.airborne:
            self._land(f"emergency land by {command.requester}")

    def _land(self, why: str) -> None:
        """Land as `safety.emergency_land` specifies, replacing a milder landing in progress."""
        modes = self.modes
        chosen = self.parameters.safety.emergency_land
        if modes.mode is Mode.EMERGENCY_LAND and chosen == "land":
            return  # as mild as any that may be under way
        {"land": modes.land, "descend": modes.descend, "emergency": modes.hand_over}[chosen](why)
