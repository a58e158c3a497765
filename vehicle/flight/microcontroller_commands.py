"""The flight stack's commands to the microcontroller, sent after each tick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from vehicle_link.serial.ids import FlightControlMode, Id, MotorState


class Ordering(Protocol):
    """The part of vehicle.flight.mode_machine.ModeMachine that commands come from."""

    @property
    def motor_state_wanted(self) -> MotorState: ...

    @property
    def flight_control_mode(self) -> FlightControlMode: ...

    @property
    def command_timeout_ms(self) -> int: ...

    def microcontroller_reports(self, lost_ports: int, obstacle: str) -> None: ...


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
    """Sends one vehicle's commands to its microcontroller."""

    def __init__(self, modes: Ordering, mcu: Ordered) -> None:
        self._modes, self._mcu = modes, mcu
        self._motor_state = modes.motor_state_wanted
        self._timeout_ms = 0

    def send(self, command: Sequence[int] | None) -> None:
        """Send the command that a tick returned, and the wanted motor state. Raises LinkError."""
        modes = self._modes
        if modes.motor_state_wanted is not self._motor_state:
            self._motor_state = modes.motor_state_wanted
            self._mcu.set_motor_state(self._motor_state)
        if command is not None:
            self._mcu.command(command, modes.flight_control_mode)

    def keep(self, now_s: float) -> None:
        """Repeat what has not been echoed yet; `now_s` is from any monotonic clock."""
        timeout_ms = self._modes.command_timeout_ms
        if timeout_ms != self._timeout_ms:
            self._timeout_ms = timeout_ms
            self._mcu.set_value(Id.EMERGENCY_TIMEOUT, timeout_ms)
        self._mcu.service(now_s)
        self._modes.microcontroller_reports(self._mcu.lost_ports, self._mcu.obstacle)
