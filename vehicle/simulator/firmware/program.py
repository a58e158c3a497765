"""One compiled period of the microcontroller: from converter counts to references."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.motor_state import MotorState
from quadrotor.records import Item
from vehicle.simulator.firmware import constants as k
from vehicle.simulator.firmware.descent import begin_descent, descend, stop, watch_thrust
from vehicle.simulator.firmware.estimation import estimate_attitude, estimate_climb
from vehicle.simulator.firmware.fixed import bounded, by16
from vehicle.simulator.firmware.hovering import hold_angles
from vehicle_link.serial.ids import FlightControlMode, Id

Registers = npt.NDArray[np.int16]
Bytes = tuple[int, int, int, int]
"""The four bytes of the newest command, 0…255."""

MISSING = -1
"""Value reported instead of the reference of a motor whose controller does not answer."""

_ACCELEROMETER, _GYROSCOPE = int(Id.ACCELEROMETER_X), int(Id.GYROSCOPE_X)
_ACCELERATION, _RATE = int(Id.ACCELERATION_X), int(Id.RATE_X)
_OFFSET, _DRIFT = int(Id.ACCELEROMETER_OFFSET_X), int(Id.GYROSCOPE_DRIFT_X)
_PITCH, _ROLL, _YAW_RATE = int(Id.PITCH), int(Id.ROLL), int(Id.YAW_RATE)
_PITCH_RATE, _ROLL_RATE = int(Id.PITCH_RATE), int(Id.ROLL_RATE)
_PRESSURE, _THRUST = int(Id.PRESSURE), int(Id.THRUST)
_STATE, _MODE = int(Id.MOTOR_STATE), int(Id.FLIGHT_CONTROL_MODE)
_MOTOR_1 = int(Id.MOTOR_REFERENCE_1)
_ON, _EMERGENCY = int(MotorState.ON), int(MotorState.EMERGENCY)
_NEAR_HOVERING = int(FlightControlMode.NEAR_HOVERING)


@compiled
def period(p: Item, registers: Registers, command: Bytes) -> None:
    """Run estimation, then control; set `references` of a PROGRAM.

    Args:
        registers: (65,), including the converters' counts.
        command: as received; interpreted by the present flight control mode.
    """
    force_b = _force(registers, 0), _force(registers, 1), _force(registers, 2)
    omega_b = _rate(registers, 0), _rate(registers, 1), _rate(registers, 2)
    state = registers[_STATE]
    p.turning = 1 if state in (_ON, _EMERGENCY) else 0
    estimate_attitude(p, omega_b, force_b)
    estimate_climb(p, -k.HEIGHT_SLOPE * registers[_PRESSURE])
    p.awake = 1
    if state == _EMERGENCY:
        if p.state != _EMERGENCY:
            begin_descent(p)
        if p.landing:
            descend(p, registers)
    elif state == _ON:
        if registers[_MODE] == _NEAR_HOVERING:
            _obey(p, registers, command)
        else:
            for i in range(4):
                p.references[i] = command[i]
    else:
        stop(p)
    p.state = state
    for i in range(4):
        if p.missing >> i & 1:
            p.references[i] = 0
    watch_thrust(p)
    _show(p, registers)


@compiled(inner=True)
def _obey(p: Item, registers: Registers, command: Bytes) -> None:
    """Carry out a near-hovering command: pitch, roll (deg × 4), yaw rate (deg/s), thrust."""
    wanted = (
        _signed(command[1]) * k.WANTED_ANGLE,
        _signed(command[0]) * k.WANTED_ANGLE,
        _signed(command[2]) * k.WANTED_YAW_RATE,
    )
    hold_angles(p, registers, wanted, (command[3] * k.WANTED_THRUST) >> 6)


@compiled(inner=True)
def _signed(byte: int) -> int:
    return byte - 256 if byte > 127 else byte


@compiled(inner=True)
def _force(registers: Registers, axis: int) -> int:
    offset: int = registers[_OFFSET + axis]
    return bounded(registers[_ACCELEROMETER + axis] - k.CONVERTER_ZERO - offset, k.FORCE_MAX)


@compiled(inner=True)
def _rate(registers: Registers, axis: int) -> int:
    count: int = registers[_GYROSCOPE + axis]
    return min(k.CONVERTER_MAX, max(0, count)) - k.CONVERTER_ZERO


@compiled(inner=True)
def _show(p: Item, registers: Registers) -> None:
    """Write the estimates into the readable registers; units are in vehicle_link.serial.values."""
    registers[_ROLL] = by16(p.roll, k.SHOW_ANGLE)
    registers[_PITCH] = by16(p.pitch, k.SHOW_ANGLE)
    for i in range(3):
        registers[_RATE + i] = (by16(p.rate_b[i], k.SHOW_RATE) + 0x400) >> 11
        registers[_DRIFT + i] = (by16(p.drift[i], k.SHOW_DRIFT) + 0x8000) >> 16
        registers[_ACCELERATION + i] = (p.force_b[i] * k.SHOW_FORCE + 0x800) >> 12
    registers[_ROLL_RATE] = registers[_RATE]
    registers[_PITCH_RATE] = registers[_RATE + 1]
    registers[_YAW_RATE] = registers[_RATE + 2]
    registers[_THRUST] = (by16(p.thrust, k.SHOW_THRUST) + 0x40000) >> 19
    for i in range(4):
        registers[_MOTOR_1 + i] = MISSING if p.missing >> i & 1 else p.references[i]
