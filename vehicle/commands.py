"""Commands to the vehicle: each is carried out whole or refused with its reason."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

from control.behaviors.machine import BehaviorMachine
from quadrotor.errors import QuadlabError, RefusedError
from quadrotor.parameters import ParameterStore, ParameterValue
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.bearings_guard import BearingsGuard
from vehicle.flight_steps import check_steps
from vehicle.modes import Flag, Mode
from vehicle.navigation import Navigation
from vehicle.parameters import VehicleParameters, check_pairs
from vehicle.steering import Steering
from vehicle.supervisor import Supervisor

WITHOUT_A_POSE = ("near_hovering", "emergency_landing")


class Commanded(Protocol):
    """What commands need of the flight stack."""

    mode: Mode
    airborne: bool
    obstacle: str
    parameters: VehicleParameters
    store: ParameterStore
    supervisor: Supervisor
    behaviors: BehaviorMachine
    navigation: Navigation
    guard: BearingsGuard
    steering: Steering
    state: Record
    status: Record
    outbox: list[mailbox.Event | mailbox.ParameterChange]

    @property
    def stamp_ns(self) -> int: ...

    @property
    def has_pose(self) -> bool: ...

    @property
    def tilt(self) -> float: ...

    def configure(self) -> None: ...

    def move(self, mode: Mode, why: str, level: int = mailbox.INFO) -> None: ...

    def say(self, text: str, level: int = mailbox.INFO) -> None: ...

    def land_now(self, why: str) -> None: ...

    def descend_now(self, why: str) -> None: ...

    def hand_over(self, why: str) -> None: ...


class CommandHandler:
    """Carries out commands between two ticks of its stack."""

    def __init__(self, stack: Commanded) -> None:
        self._stack = stack

    def handle(self, command: mailbox.Command) -> mailbox.Reply:
        """The reply; a refusal changes nothing and is logged with who asked."""
        stack = self._stack
        applied: dict[str, ParameterValue] = {}
        try:
            if isinstance(command, mailbox.ChangeParameters):
                applied = self._change_parameters(command)
            elif isinstance(command, mailbox.Arm):
                self._arm(command.requester)
            elif isinstance(command, mailbox.Disarm):
                self._disarm(command.requester)
            elif isinstance(command, mailbox.StartBehavior):
                self._start_behavior(command)
            else:
                self._emergency(command)
        except QuadlabError as error:
            stack.say(f"refused {command.requester}: {error}", mailbox.WARN)
            return mailbox.Reply(command.request_id, False, str(error))
        return mailbox.Reply(command.request_id, True, "", applied, stack.store.revision)

    def _change_parameters(self, command: mailbox.ChangeParameters) -> dict[str, ParameterValue]:
        stack = self._stack
        checked = {name: stack.store.check(name, v) for name, v in command.values.items()}
        check_pairs(stack.store.values() | checked)
        if stack.airborne:
            check_steps(stack.store, checked)
        armed = stack.mode in (Mode.ARMED, Mode.EMERGENCY_LAND)
        stack.steering.check(checked, armed)
        stack.guard.check(checked, armed)
        checked |= stack.navigation.check(checked, stack.state, armed)
        return self.apply(checked, command.requester)

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

    def _arm(self, requester: str) -> None:
        stack = self._stack
        if stack.mode is Mode.ARMED:
            raise RefusedError("already armed")
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
            voltage = float(stack.status["battery_voltage"][0])
            limit = stack.parameters.safety.battery_warning
            raise RefusedError(f"not armed: battery at {voltage:.1f} V, needs {limit:.1f} V")
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
        elif stack.mode is Mode.ARMED and not stack.airborne:
            stack.move(Mode.READY, f"emergency land on the ground by {command.requester}")
        elif stack.mode is not Mode.CUT and stack.airborne:
            self._land(f"emergency land by {command.requester}")

    def _land(self, why: str) -> None:
        """As `safety.emergency_land` says; a milder landing that is under way gives way to it."""
        stack = self._stack
        chosen = stack.parameters.safety.emergency_land
        if stack.mode is Mode.EMERGENCY_LAND and chosen == "land":
            return  # as mild as any that may be under way
        {
            "land": stack.land_now,
            "descend": stack.descend_now,
            "emergency": stack.hand_over,
        }[chosen](why)
