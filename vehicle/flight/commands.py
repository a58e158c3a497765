"""Commands to the vehicle: each is carried out whole or refused with its reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from control.behaviors.machine import BehaviorMachine
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.parameters import ParameterStore, ParameterValue
from quadrotor.records import Record
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.flight.control_law import Steering
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.modes import Flag, Mode
from vehicle.flight.motor_bench import Bench, check_bench
from vehicle.flight.parameter_steps import check_steps
from vehicle.parameters import VehicleParameters, check_pairs
from vehicle.processes import mailbox
from vehicle.safety.supervisor import Supervisor

WITHOUT_A_POSE = ("near_hovering", "emergency_landing")


class Commanded(Protocol):
    """The part of the flight stack that commands need."""

    mode: Mode
    obstacle: str
    parameters: VehicleParameters
    store: ParameterStore
    supervisor: Supervisor
    behaviors: BehaviorMachine
    navigation: Navigation
    guard: BearingsGuard
    steering: Steering
    mass: FlownMass
    state: Record
    status: Record
    outbox: list[mailbox.Told]
    bench: Bench

    @property
    def airborne(self) -> bool: ...

    @property
    def stamp_ns(self) -> int: ...

    @property
    def has_pose(self) -> bool: ...

    @property
    def tilt(self) -> float: ...

    def configure(self) -> None: ...

    def move(self, mode: Mode, why: str, level: int = mailbox.INFO) -> None: ...

    def say(self, text: str, level: int = mailbox.INFO) -> None: ...

    def begin_gyroscope(self, command: mailbox.CalibrateGyroscope) -> None: ...

    def land_now(self, why: str) -> None: ...

    def descend_now(self, why: str) -> None: ...

    def hand_over(self, why: str) -> None: ...


class CommandHandler:
    """Carries out commands between two ticks of its stack."""

    def __init__(self, stack: Commanded) -> None:
        self._stack = stack

    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        """Handle a command and return the reply; a refusal changes nothing and is logged with who
        asked.
        """
        stack = self._stack
        applied: dict[str, ParameterValue] = {}
        previous: dict[str, ParameterValue] = {}
        try:
            if isinstance(command, mailbox.ChangeParameters):
                applied = self._change_parameters(command)
            elif isinstance(command, mailbox.Arm):
                self._arm(command.requester)
            elif isinstance(command, mailbox.Disarm):
                self._disarm(command.requester)
            elif isinstance(command, mailbox.StartBehavior):
                self._start_behavior(command)
            elif isinstance(command, mailbox.Emergency):
                self._emergency(command)
            elif isinstance(command, mailbox.Calibrate):
                applied, previous = self._calibrate(command)
            elif isinstance(command, mailbox.CalibrateGyroscope):
                self._require_rest("gyroscope not calibrated")
                stack.begin_gyroscope(command)
            else:
                self._bench(command)
        except QuadlabError as error:
            stack.say(f"refused {command.requester}: {error}", mailbox.WARN)
            return mailbox.Reply(command.request_id, False, str(error))
        revision = stack.store.revision
        return mailbox.Reply(command.request_id, True, "", applied, revision, previous)

    def _change_parameters(self, command: mailbox.ChangeParameters) -> dict[str, ParameterValue]:
        return self.apply(self._checked(command.values), command.requester)

    def _checked(self, values: Mapping[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Return what is to be set, and what has to be set with it. Raises QuadlabError."""
        stack = self._stack
        checked = {name: stack.store.check(name, value) for name, value in values.items()}
        check_pairs(stack.store.values() | checked)
        if stack.airborne:
            check_steps(stack.store, checked)
        armed = stack.mode in (Mode.ARMED, Mode.EMERGENCY_LAND)
        stack.steering.check(checked, armed)
        stack.mass.check(checked, armed)
        stack.guard.check(checked, armed)
        return checked | stack.navigation.check(checked, stack.state, armed)

    def apply(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> dict[str, ParameterValue]:
        """Set parameters that were checked, tell each part and the log."""
        stack = self._stack
        old = {name: stack.store.get(name) for name in values}
        applied = stack.store.set(values)
        stack.configure()
        for name, value in applied.items():
            stack.outbox.append(
                mailbox.ParameterChange(
                    stamp_ns=stack.stamp_ns,
                    name=name,
                    old=old[name],
                    new=value,
                    requester=requester,
                    revision=stack.store.revision,
                )
            )
        return applied

    def _calibrate(
        self, command: mailbox.Calibrate
    ) -> tuple[dict[str, ParameterValue], dict[str, ParameterValue]]:
        """Calibrate, and return (applied, before)."""
        self._require_rest("calibration not taken over")
        checked = self._checked(command.values)
        before = {name: self._stack.store.get(name) for name in checked}
        return self.apply(checked, command.requester), before

    def _bench(self, command: mailbox.Bench) -> None:
        stack, motor = self._stack, command.motor
        if motor == 0:
            if stack.mode is Mode.BENCH:
                stack.move(Mode.READY, f"{stack.bench} taken off the bench by {command.requester}")
            return  # else nothing turns, as was asked for
        check_bench(motor, command.reference)
        if stack.mode is not Mode.BENCH:
            self._require_rest("bench refused")
            if not command.secured:
                raise RefusedError(
                    "bench refused: confirm first that the propellers are off or the vehicle is "
                    "fixed (secured)"
                )
            if stack.obstacle:
                raise RefusedError(f"bench refused: {stack.obstacle}")
            if stack.supervisor.flags & Flag.BATTERY_LOW:
                raise RefusedError(f"bench refused: {self._low_battery()}")
        stack.bench.turn(motor, command.reference, stack.stamp_ns)
        if stack.mode is not Mode.BENCH:
            stack.move(Mode.BENCH, f"{stack.bench} by {command.requester}")

    def _require_rest(self, refused: str) -> None:
        """Raise RefusedError unless the vehicle is on the ground with its motors off."""
        stack = self._stack
        if stack.airborne:
            why = "the vehicle is in flight; land and disarm first"
        elif stack.mode is Mode.STARTING:
            why = "the gyroscope is being calibrated; wait until it is, and keep the vehicle still"
        elif stack.mode is Mode.CUT:
            why = "the motors were cut; disarm first to acknowledge it"
        elif stack.mode is Mode.BENCH:
            why = f"motors are on: {stack.bench} is on the bench; end it (motor 0) first"
        elif stack.mode is not Mode.READY:
            why = "motors are on; disarm first"
        else:
            return
        raise RefusedError(f"{refused}: {why}")

    def _low_battery(self) -> str:
        stack = self._stack
        voltage = float(stack.status["battery_voltage"][0])
        return f"battery at {voltage:.1f} V, needs {stack.parameters.safety.battery_warning:.1f} V"

    def _arm(self, requester: str) -> None:
        stack = self._stack
        if stack.mode is Mode.ARMED:
            raise RefusedError("already armed")
        if stack.mode is Mode.BENCH:
            raise RefusedError(f"not armed: {stack.bench} is on the bench; end it first")
        if stack.mode is Mode.STARTING:
            raise RefusedError("not armed: the gyroscope is still being calibrated; keep it still")
        if stack.mode is Mode.CUT:
            raise RefusedError("not armed: the motors were cut; disarm first to acknowledge it")
        if stack.obstacle:
            raise RefusedError(f"not armed: {stack.obstacle}")
        if not stack.has_pose:
            raise RefusedError("not armed: no fresh pose measurement; check tracker and station")
        stack.guard.check_take_off()
        flags = stack.supervisor.flags
        if flags & Flag.LINK_LOST:
            raise RefusedError("not armed: the station is not heard; check the link")
        if flags & Flag.BATTERY_LOW:
            raise RefusedError(f"not armed: {self._low_battery()}")
        tilt, limit = math.degrees(stack.tilt), stack.parameters.safety.arm_tilt_max
        if tilt > limit:
            raise RefusedError(f"not armed: tilted by {tilt:.0f} deg, allowed {limit:.0f} deg")
        stack.move(Mode.ARMED, f"by {requester}")

    def _disarm(self, requester: str) -> None:
        stack = self._stack
        if stack.mode in (Mode.STARTING, Mode.READY):
            raise RefusedError("not armed, so nothing to disarm")
        if stack.airborne:
            raise RefusedError("not disarmed: flying; land first, or use the emergency cut")
        stack.move(Mode.READY, f"disarmed by {requester}")

    def _start_behavior(self, command: mailbox.StartBehavior) -> None:
        stack = self._stack
        if stack.mode is Mode.EMERGENCY_LAND:
            raise RefusedError(f"{command.name} refused: emergency landing; only cut is open")
        if stack.mode is Mode.BENCH:
            raise RefusedError(
                f"{command.name} refused: {stack.bench} is on the bench; end it, then arm"
            )
        held = stack.behaviors.level is None
        if not held and not stack.has_pose and command.name not in WITHOUT_A_POSE:
            raise RefusedError(
                f"{command.name} refused: no fresh pose measurement to hold the vehicle by; "
                f"possible now: {', '.join(WITHOUT_A_POSE)}"
            )
        stack.behaviors.request(
            command.name,
            command.arguments,
            stack.state,
            armed=stack.mode is Mode.ARMED,
            airborne=stack.airborne,
        )
        stack.say(f"{command.name} by {command.requester}")

    def _emergency(self, command: mailbox.Emergency) -> None:
        stack = self._stack
        if command.action not in ("land", "cut"):
            raise RefusedError(f"unknown emergency action {command.action!r}: use land or cut")
        if stack.mode in (Mode.STARTING, Mode.READY):
            raise RefusedError(f"emergency {command.action} refused: the motors are off")
        if command.action == "cut":
            if stack.mode is not Mode.CUT:
                stack.move(Mode.CUT, f"emergency cut by {command.requester}", mailbox.ERROR)
        elif stack.mode is Mode.BENCH or (stack.mode is Mode.ARMED and not stack.airborne):
            stack.move(Mode.READY, f"emergency land on the ground by {command.requester}")
        elif stack.mode is not Mode.CUT and stack.airborne:
            self._land(f"emergency land by {command.requester}")

    def _land(self, why: str) -> None:
        """Land as `safety.emergency_land` says; a milder landing that is under way gives way to
        it.
        """
        stack = self._stack
        chosen = stack.parameters.safety.emergency_land
        if stack.mode is Mode.EMERGENCY_LAND and chosen == "land":
            return  # as mild as any that may be under way
        {"land": stack.land_now, "descend": stack.descend_now, "emergency": stack.hand_over}[
            chosen
        ](why)
