"""The flight stack's commands to the board, made and sent after each tick."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from control.rate_law import angles_of_rates, rates_of_wrench
from quadrotor.motor_state import MotorState
from quadrotor.records import Record
from quadrotor.vehicle_model import GRAVITY
from vehicle.boards.board import Board, BodyRates, Command, CommandKind, TakesPoses, Traits
from vehicle.boards.reference_rounding import ReferenceRounding
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.tick_record import TickRecord
from vehicle_link.serial.attitude_command import AttitudeCommand

RATE_MAX = math.radians(300.0)
"""Fastest rotation, in rad/s, that is commanded about each axis."""


def command_maker(board: Traits, tick: TickRecord, law: ControlLaw) -> Callable[[], Command]:
    """Return the function that turns a tick's wrench into a command at the level that the board
    accepts first.
    """
    level = board.takes[0]
    if level is CommandKind.MOTORS:
        rounding = ReferenceRounding()
        return lambda: rounding.round(tick.motor_references)

    omega_b = tick.state["angular_velocity_b"][0]  # a view

    def rates() -> BodyRates:
        x, y, z, throttle = rates_of_wrench(tick.wrench, omega_b, law.gains, law.model, RATE_MAX)
        return BodyRates((x, y, z), throttle, tick.wrench.item(0))

    quaternion_wb = tick.state["quaternion_wb"][0]  # a view

    def angles() -> AttitudeCommand:
        x, y, z, throttle = rates_of_wrench(tick.wrench, omega_b, law.gains, law.model, RATE_MAX)
        roll, pitch = angles_of_rates(quaternion_wb, x, y, board.angle_gain)
        thrust = tick.wrench.item(0)
        return AttitudeCommand(roll, pitch, z, thrust / (law.mass * GRAVITY), thrust, throttle)

    made = angles if level is CommandKind.ANGLES else rates
    made()  # compile now rather than in the first flight
    return made


class CommandedModes(Protocol):
    """The part of vehicle.flight.mode_machine.ModeMachine that commands depend on."""

    @property
    def motor_state_wanted(self) -> MotorState: ...

    @property
    def command_timeout(self) -> float: ...

    @property
    def located(self) -> Record | None: ...

    def microcontroller_reports(self, lost_ports: int, obstacle: str) -> None: ...


class CommandSender:
    """Sender of one vehicle's commands to its board."""

    def __init__(self, modes: CommandedModes, board: Board) -> None:
        self._modes, self._board = modes, board
        self._poses = board if isinstance(board, TakesPoses) else None
        self._motor_state = modes.motor_state_wanted
        self._timeout = 0.0

    def send(self, command: Command | None) -> None:
        """Send a tick's command, and the requested motor state. Raises LinkError."""
        modes = self._modes
        if modes.motor_state_wanted is not self._motor_state:
            self._motor_state = modes.motor_state_wanted
            self._board.set_motor_state(self._motor_state)
        if command is not None:
            self._board.command(command)

    def service(self, now_s: float) -> None:
        """Repeat commands without an echo; `now_s` is from any monotonic clock."""
        timeout = self._modes.command_timeout
        if timeout != self._timeout:
            self._timeout = timeout
            self._board.set_command_timeout(round(1000 * timeout))
        if self._poses is not None and (state := self._modes.located) is not None:
            self._poses.locate(state, now_s)
        self._board.service(now_s)
        self._modes.microcontroller_reports(self._board.lost_ports, self._board.obstacle)
