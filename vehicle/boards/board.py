"""The interface of every board: what it accepts, what it reports, and what it can do alone.

A board is the hardware between the flight stack and the motors, with inertial sensors and its own
processor. The control law ends at the lowest level that the board accepts: motor references if it
gives access to the motors, otherwise body rates and collective thrust, with the inner loop on the
board, or angles, with its angle loop above that.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Protocol, runtime_checkable

import msgspec

from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle_link.link_counts import LinkCounts
from vehicle_link.serial.attitude_command import AttitudeCommand


class CommandKind(Enum):
    """The kind of command that a board accepts."""

    MOTORS = "motor references"
    RATES = "body rates and collective thrust"
    ANGLES = "roll, pitch, yaw rate and collective thrust"


class BodyRates(msgspec.Struct, frozen=True):
    """A command of body rates and collective thrust."""

    rates_b: tuple[float, float, float]  # rad/s, body axes (x forward, y left, z up)
    throttle: float  # 0…1, the share of full motor reference that gives the commanded thrust
    thrust: float = 0.0  # N, the same thrust


MotorReferences = tuple[int, int, int, int]
"""Counts, 0…255, motors front, left, rear, right."""
Command = MotorReferences | BodyRates | AttitudeCommand
"""Command at one of the levels of `CommandKind`."""


class RawSample(msgspec.Struct, frozen=True, order=True):
    """One IMU sample as the sensors gave it, ordered by its stamp."""

    stamp_ns: int  # by the vehicle's clock
    accelerometer: tuple[int, int, int]  # counts, axes x, y, z; `imu` has zero and scale
    gyroscope: tuple[int, int, int]  # counts
    battery_voltage: float  # V
    pressure: float  # Pa
    motor_state: MotorState


class Traits(msgspec.Struct, frozen=True):
    """The facts about a kind of board that the flight stack needs."""

    name: str
    takes: tuple[CommandKind, ...]  # the control law ends at the first
    parameters: dict[str, ParameterValue] = {}  # values that replace the defaults
    reports_pressure: bool = True  # otherwise only the board itself can descend by a barometer
    angle_gain: float = 5.0  # 1/s, the rate that its angle loop demands for an error
    line_ns: int = 0  # time of a sample on the line, which its stamp does not include

    def missing(self, needed: CommandKind) -> str:
        """Return why the board cannot be commanded at this level, "" when it can."""
        if needed in self.takes:
            return ""
        taken = " or ".join(one.value for one in self.takes)
        return f"board {self.name} takes {taken}, no {needed.value}"


class Board(Protocol):
    """A board, as the flight loop uses it; no method blocks.

    Attributes:
        failures: lines about requests given up, lost ports and anything else that an operator has
            to know, which the caller reports and clears.
        refused: number of samples with impossible values or times.
        late: number of samples dropped because they were older than the newest one.
        newest_ms: the board's time, ms modulo 60 s, in the last sample of each port; -1 before the
            first.
    """

    failures: list[str]
    newest_ms: list[int]
    refused: int
    late: int

    @property
    def damaged(self) -> int:
        """Return the number of byte sequences that are not valid frames."""
        ...

    @property
    def lost_ports(self) -> int:
        """Return the number of lost ports."""
        ...

    @property
    def obstacle(self) -> str:
        """Return the known reason why the motors would not start; empty when they would."""
        ...

    def filenos(self) -> Sequence[int]:
        """Return the file descriptors to wait for."""
        ...

    def receive(self) -> list[RawSample]:
        """Return the samples that arrived, oldest first.

        Raises LinkError when the last port is lost.
        """
        ...

    def command(self, command: Command) -> None:
        """Send a command at a level that the board accepts."""
        ...

    def set_motor_state(self, state: MotorState) -> None:
        """Request this motor state until it is reached.

        EMERGENCY leaves the landing to the board.
        """
        ...

    def set_command_timeout(self, milliseconds: int) -> None:
        """Request that the board lands by itself this many ms after the last command."""
        ...

    def service(self, now_s: float) -> None:
        """Send all messages that are due, also retries; `now_s` is from any monotonic clock."""
        ...


@runtime_checkable
class TellsLink(Protocol):
    """A board that counts the messages of its link."""

    @property
    def link(self) -> LinkCounts:
        """Return the counts up to now."""
        ...


@runtime_checkable
class ConfirmsParameters(Protocol):
    """A board with parameters of its own, which are parameters of the vehicle, too."""

    confirmed: dict[str, ParameterValue]
    """Values by which those of the vehicle must be replaced; the caller clears it."""


@runtime_checkable
class TakesPoses(Protocol):
    """A board with a state estimator of its own, which needs poses."""

    def locate(self, state: Record, now_s: float) -> None:
        """Send the flight stack's STATE (1,) when that is due."""
        ...
