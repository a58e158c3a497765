"""The flight stack's orders to the microcontroller, sent after each tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from vehicle_link.serial.ids import FlightControlMode, Id, MotorState


class Ordering(Protocol):
    """The part of vehicle.flight.stack.FlightStack that is read here."""

    motor_state_wanted: MotorState
    lost_ports: int
    obstacle: str

    @property
    def flight_control_mode(self) -> FlightControlMode: ...

    @property
    def command_timeout_ms(self) -> int: ...


class Ordered(Protocol):
    """The part of vehicle.microcontroller.microcontroller.Microcontroller that is called here."""

    @property
    def lost_ports(self) -> int: ...

    @property
    def obstacle(self) -> str: ...

    def command(self, command: Sequence[int], mode: FlightControlMode) -> None: ...
    def set_motor_state(self, state: MotorState) -> None: ...
    def set_value(self, id: Id, value: int) -> None: ...
    def service(self, now_s: float) -> None: ...


class Orders:
    """The orders of one stack to one microcontroller."""

    def __init__(self, stack: Ordering, mcu: Ordered) -> None:
        self._stack, self._mcu = stack, mcu
        self._motor_state = stack.motor_state_wanted
        self._timeout_ms = 0

    def send(self, command: Sequence[int] | None) -> None:
        """Send what a tick returned, and the motor state it wants. Raises LinkError."""
        stack = self._stack
        if stack.motor_state_wanted is not self._motor_state:
            self._motor_state = stack.motor_state_wanted
            self._mcu.set_motor_state(self._motor_state)
        if command is not None:
            self._mcu.command(command, stack.flight_control_mode)

    def keep(self, now_s: float) -> None:
        """Repeat what is not echoed yet; `now_s` is any clock that does not go back."""
        timeout_ms = self._stack.command_timeout_ms
        if timeout_ms != self._timeout_ms:
            self._timeout_ms = timeout_ms
            self._mcu.set_value(Id.EMERGENCY_TIMEOUT, timeout_ms)
        self._mcu.service(now_s)
        self._stack.lost_ports = self._mcu.lost_ports
        self._stack.obstacle = self._mcu.obstacle
