"""The flight stack's commands to the board, sent after each tick."""

from __future__ import annotations

from typing import Protocol

from quadrotor.records import Record
from vehicle.boards.board import Board, Command, TakesPoses
from vehicle_link.serial.ids import MotorState


class Ordering(Protocol):
    """The part of vehicle.flight.mode_machine.ModeMachine that commands depend on."""

    @property
    def motor_state_wanted(self) -> MotorState: ...

    @property
    def command_timeout_ms(self) -> int: ...

    @property
    def located(self) -> Record | None: ...

    def microcontroller_reports(self, lost_ports: int, obstacle: str) -> None: ...


class Orders:
    """Sender of one vehicle's commands to its board."""

    def __init__(self, modes: Ordering, board: Board) -> None:
        self._modes, self._board = modes, board
        self._poses = board if isinstance(board, TakesPoses) else None
        self._motor_state = modes.motor_state_wanted
        self._timeout_ms = 0

    def send(self, command: Command | None) -> None:
        """Send a tick's command, and the requested motor state. Raises LinkError."""
        modes = self._modes
        if modes.motor_state_wanted is not self._motor_state:
            self._motor_state = modes.motor_state_wanted
            self._board.set_motor_state(self._motor_state)
        if command is not None:
            self._board.command(command)

    def keep(self, now_s: float) -> None:
        """Repeat commands without an echo; `now_s` is from any monotonic clock."""
        timeout_ms = self._modes.command_timeout_ms
        if timeout_ms != self._timeout_ms:
            self._timeout_ms = timeout_ms
            self._board.set_command_timeout(timeout_ms)
        if self._poses is not None and (state := self._modes.located) is not None:
            self._poses.locate(state, now_s)
        self._board.service(now_s)
        self._modes.microcontroller_reports(self._board.lost_ports, self._board.obstacle)
