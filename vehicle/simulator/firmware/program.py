"""One compiled period of the microcontroller: from converter counts to references."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.vehicle_model import GRAVITY
from vehicle.simulator.firmware.attitude import angles, estimate_attitude
from vehicle.simulator.firmware.descent import begin_descent, descend, stop, watch_thrust
from vehicle.simulator.firmware.hovering import hold_angles
from vehicle.simulator.firmware.vertical import estimate_climb
from vehicle.simulator.sensors import ACCELEROMETER_SCALE, GYROSCOPE_SCALE, PRESSURE_LAPSE, ZERO
from vehicle_link.serial.attitude_command import HOVER_THRUST
from vehicle_link.serial.ids import FlightControlMode, Id, MotorState

Item = Any
"""One record `array[k]` inside compiled code."""
Registers = npt.NDArray[np.int16]
Bytes = tuple[int, int, int, int]
"""The four bytes of the newest command, 0…255."""

MISSING = -1
"""Reported instead of the reference of a motor whose controller does not answer."""

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
_DEGREES = 180.0 / math.pi


@compiled(inner=True)
def period(p: Item, registers: Registers, command: Bytes, dt: float) -> None:
    """Run estimation, then control: sets `references` of a PROGRAM.

    Args:
        registers: (65,), including the converters' counts.
        command: as received; interpreted by the present flight control mode.
        dt: s.
    """
    force_b = (
        _acceleration(registers, 0),
        _acceleration(registers, 1),
        _acceleration(registers, 2),
    )
    omega_b = (_rate(registers, 0), _rate(registers, 1), _rate(registers, 2))
    state = registers[_STATE]
    p.turning = 1 if state in (_ON, _EMERGENCY) else 0
    estimate_attitude(p, omega_b, force_b, dt)
    estimate_climb(p, -registers[_PRESSURE] / PRESSURE_LAPSE, dt)
    p.awake = 1
    if state == _EMERGENCY:
        if p.state != _EMERGENCY:
            begin_descent(p)
        if p.landing:
            descend(p, registers, dt)
    elif state == _ON:
        if registers[_MODE] == _NEAR_HOVERING:
            _obey(p, registers, command, dt)
        else:
            for i in range(4):
                p.references[i] = command[i]
    else:
        stop(p)
    p.state = state
    for i in range(4):
        if p.missing >> i & 1:
            p.references[i] = 0
    watch_thrust(p, dt)
    _show(p, registers)


@compiled(inner=True)
def _obey(p: Item, registers: Registers, command: Bytes, dt: float) -> None:
    """Obey a near-hovering command: pitch, roll (deg × 4), yaw rate (deg/s), thrust."""
    wanted = (
        _signed(command[1]) / (4.0 * _DEGREES),
        _signed(command[0]) / (4.0 * _DEGREES),
        _signed(command[2]) / _DEGREES,
    )
    thrust = command[3] * p.model.mass * GRAVITY / HOVER_THRUST
    hold_angles(p, registers, wanted, thrust, dt)


@compiled(inner=True)
def _signed(byte: int) -> int:
    return byte - 256 if byte > 127 else byte


@compiled(inner=True)
def _acceleration(registers: Registers, axis: int) -> float:
    counts: float = registers[_ACCELEROMETER + axis] - ZERO - registers[_OFFSET + axis]
    return ACCELEROMETER_SCALE * counts


@compiled(inner=True)
def _rate(registers: Registers, axis: int) -> float:
    counts: float = registers[_GYROSCOPE + axis] - ZERO
    return GYROSCOPE_SCALE * counts


@compiled(inner=True)
def _show(p: Item, registers: Registers) -> None:
    """Write the estimates into the registers that can be requested; units in
    vehicle_link.serial.values.
    """
    roll, pitch, _ = angles(p)
    registers[_ROLL] = _count(10.0 * _DEGREES * roll)
    registers[_PITCH] = _count(10.0 * _DEGREES * pitch)
    for i in range(3):
        rate = 10.0 * _DEGREES * p.angular_velocity_b[i]
        registers[_RATE + i] = _count(rate)
        registers[_DRIFT + i] = _count(100.0 * _DEGREES * p.gyroscope_bias[i])
        registers[_ACCELERATION + i] = _count(100.0 * p.specific_force_b[i])
    registers[_ROLL_RATE] = registers[_RATE]
    registers[_PITCH_RATE] = registers[_RATE + 1]
    registers[_YAW_RATE] = registers[_RATE + 2]
    registers[_THRUST] = _count(HOVER_THRUST * p.thrust / (p.model.mass * GRAVITY))
    for i in range(4):
        registers[_MOTOR_1 + i] = MISSING if p.missing >> i & 1 else p.references[i]


@compiled(inner=True)
def _count(value: float) -> int:
    return int(min(32767.0, max(-32768.0, math.floor(value + 0.5))))
