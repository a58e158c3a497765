"""The readings of the microcontroller's converters: noisy, biased, whole counts.

Accelerometer ±2 g and gyroscope ±300 deg/s in 10 bit (Sec. 2), barometer by the lapse of the
standard atmosphere, battery in 0.1 V. Random numbers are drawn in blocks, from one seed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.vectors import Vector
from quadrotor.vehicle_model import GRAVITY
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.vibration import IMBALANCE, lines
from vehicle_link.serial.ids import PRESSURE_OFFSET, Id

Array = npt.NDArray[np.float64]
Registers = npt.NDArray[np.int16]

ACCELEROMETER_SCALE = 0.0039 * GRAVITY
"""Scale, in m/s^2 per count."""
GYROSCOPE_SCALE = math.radians(0.586)
"""Scale, in rad/s per count."""
ZERO, FULL_SCALE = 512, 1023
PRESSURE_LAPSE = 11.6
"""Pressure lost per height, in Pa/m, in the lowest few hundred metres of the standard atmosphere.
"""
CHANNELS = 11
"""Number of random numbers per sample: accelerometer 3, gyroscope 3, pressure, battery; gusts 3."""
STUCK_PRESSURE, STUCK_BATTERY = 6, 7
"""Channels of the pressure and the battery."""
GUSTS = 8
"""First channel of the gusts."""
BLOCK = 512
WARM_UP_TIME = 120.0
"""Time constant, in s, of a sensor's warm-up."""

_ACCELEROMETER, _GYROSCOPE = int(Id.ACCELEROMETER_X), int(Id.GYROSCOPE_X)
_BATTERY, _PRESSURE = int(Id.BATTERY), int(Id.PRESSURE)
_VOLTAGE_NOISE = 0.02  # V

SENSORS = np.dtype(
    [
        ("accelerometer_matrix", "f8", (3, 3)),  # inverse of T: body axes to the sensor's
        ("accelerometer_bias", "f8", 3),  # m/s^2
        ("accelerometer_noise", "f8"),  # m/s^2
        ("gyroscope_bias", "f8", 3),  # rad/s
        ("gyroscope_noise", "f8"),  # rad/s
        ("ground_pressure", "f8"),  # Pa
        ("pressure_noise", "f8"),  # Pa
        ("vibration", "f8"),  # m/s^2, at hover speed
        ("vibration_gyroscope", "f8"),  # rad/s, at hover speed
        ("hover_thrust", "f8"),  # N, of one rotor
        ("accelerometer_warm_up", "f8"),  # m/s^2, change of each bias until warm
        ("gyroscope_warm_up", "f8"),  # rad/s
        ("warmth", "f8"),  # 0 when switched on, 1 when warm
        ("gyroscope_matrix", "f8", (3, 3)),  # body axes to the sensor's
        ("accelerometer_range", "f8"),  # m/s^2, beyond which readings stay at it
        ("gyroscope_range", "f8"),  # rad/s
        ("imbalance", "f8", 4),  # of each rotor, relative
        ("stuck", "i8", 8),  # 1: this channel keeps its last reading; in the order of CHANNELS
        ("pressure", "f8"),  # Pa, the last reading
        ("voltage", "f8"),  # V, the last reading
    ],
    align=True,
)


_LAST = ("warmth", "pressure", "voltage")
"""Fields that a change of the parameters keeps."""


def new_sensors(parameters: SimulatorParameters) -> Record:
    """Return a SENSORS record, shape (1,)."""
    p = parameters
    sensors = np.zeros(1, SENSORS)
    sensors["accelerometer_matrix"] = np.linalg.inv(p.accelerometer_matrix)
    for name in (
        *("accelerometer_noise", "ground_pressure", "pressure_noise"),
        *("vibration", "accelerometer_warm_up"),
    ):
        sensors[name] = getattr(p, name)
    for name in ("gyroscope_noise", "vibration_gyroscope", "gyroscope_warm_up"):
        sensors[name] = math.radians(getattr(p, name))
    sensors["accelerometer_bias"] = [getattr(p, f"accelerometer_bias_{axis}") for axis in "xyz"]
    sensors["gyroscope_bias"] = np.radians([getattr(p, f"gyroscope_bias_{axis}") for axis in "xyz"])
    sensors["hover_thrust"] = 0.25 * p.mass * GRAVITY
    sensors["gyroscope_matrix"] = np.eye(3)
    sensors["accelerometer_range"] = sensors["gyroscope_range"] = math.inf
    sensors["imbalance"] = IMBALANCE
    return sensors


def configure_sensors(sensors: Record, parameters: SimulatorParameters) -> None:
    """Set new true values of a SENSORS record, keeping its last readings."""
    last = [sensors[name].copy() for name in _LAST]
    sensors[...] = new_sensors(parameters)
    for name, reading in zip(_LAST, last, strict=True):
        sensors[name] = reading


class Noise:
    """Standard normal numbers, `CHANNELS` per sample, drawn one block at a time."""

    def __init__(self, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self.block = np.empty((BLOCK, CHANNELS))
        self._row = BLOCK

    def next_rows(self, count: int) -> int:
        """Return the first of `count` rows of `block` to use for the next samples."""
        row = self._row
        if row + count > BLOCK:
            self._generator.standard_normal(out=self.block)
            row = 0
        self._row = row + count
        return row


@compiled(inner=True)
def _count(value: float, low: int, high: int) -> int:
    return int(min(max(math.floor(value + 0.5), low), high))


@compiled(inner=True)
def sensed_force(matrix: Array, force_b: Array, axis: int) -> float:
    """Return the specific force (m/s^2) along one sensor axis: a row of T^-1 f of Sec. 5.2."""
    row = matrix[axis]
    out: float = row[0] * force_b[0] + row[1] * force_b[1] + row[2] * force_b[2]
    return out


@compiled(inner=True)
def _sensed_rate(p: Item, s: Item, axis: int) -> float:
    """Return the angular velocity (rad/s) along one sensor axis."""
    row = s.gyroscope_matrix[axis]
    out: float = row[0] * p.x[10] + row[1] * p.x[11] + row[2] * p.x[12]
    return out


@compiled(inner=True)
def _within(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


@compiled(inner=True)
def accelerometer_count(
    force: float, bias: float, deviation: float, normal: float, limit: float
) -> int:
    """Return the count of one axis for a specific force (m/s^2), which is cut off at the limit.

    Args:
        normal: standard normal number.
    """
    value = _within(force + bias + deviation * normal, limit)
    return _count(value / ACCELEROMETER_SCALE + ZERO, 0, FULL_SCALE)


@compiled(inner=True)
def gyroscope_count(rate: float, bias: float, deviation: float, normal: float, limit: float) -> int:
    """Return the count of one axis for an angular velocity (rad/s), which is cut off at the limit.

    Args:
        normal: standard normal number.
    """
    value = _within(rate + bias + deviation * normal, limit)
    return _count(value / GYROSCOPE_SCALE + ZERO, 0, FULL_SCALE)


@compiled(inner=True)
def _shaking(p: Item, s: Item) -> tuple[Vector, float, float]:
    """Return the rotors' lines of vibration, and the deviations of the rest: m/s^2, rad/s."""
    if s.vibration > 0.0 or s.vibration_gyroscope > 0.0:
        rotor, broadband = lines(p, s.imbalance, s.hover_thrust)
        return (
            rotor,
            math.hypot(s.accelerometer_noise, broadband * s.vibration),
            math.hypot(s.gyroscope_noise, broadband * s.vibration_gyroscope),
        )
    return (0.0, 0.0, 0.0), s.accelerometer_noise, s.gyroscope_noise


@compiled(inner=True)
def sensed_pressure(p: Item, s: Item, noise: Array, row: int) -> float:
    """Return the barometer's reading, Pa, for one record of PLANT and one of SENSORS."""
    mean: float = s.ground_pressure - PRESSURE_LAPSE * p.x[2]
    pressure: float = mean + s.pressure_noise * noise[row, 6]
    return pressure


@compiled
def sense(plant: Record, sensors: Record, noise: Array, row: int, sensed: Array) -> float:
    """Write the readings of finer sensors for a PLANT (1,) into (2, 3): m/s^2 and rad/s, body axes.

    Returns the barometer's reading, Pa. A stuck channel keeps its last reading.
    """
    p, s = plant[0], sensors[0]
    rotor, shaken, twisted = _shaking(p, s)
    for i in range(3):
        if s.stuck[i] == 0:
            force = sensed_force(s.accelerometer_matrix, p.specific_force_b, i)
            bias = s.accelerometer_bias[i] + s.warmth * s.accelerometer_warm_up
            value = force + s.vibration * rotor[i] + bias + shaken * noise[row, i]
            sensed[0, i] = _within(value, s.accelerometer_range)
        if s.stuck[3 + i] == 0:
            drift = s.gyroscope_bias[i] + s.warmth * s.gyroscope_warm_up
            rate = _sensed_rate(p, s, i) + s.vibration_gyroscope * rotor[i]
            sensed[1, i] = _within(rate + drift + twisted * noise[row, 3 + i], s.gyroscope_range)
    if s.stuck[STUCK_PRESSURE] == 0:
        s.pressure = sensed_pressure(p, s, noise, row)
    if s.stuck[STUCK_BATTERY] == 0:
        s.voltage = p.voltage
    pressure: float = s.pressure
    return pressure


@compiled
def sample(plant: Record, sensors: Record, noise: Array, row: int, registers: Registers) -> None:
    """Write the counts of a PLANT (1,) into the registers (65,), with noise row `row`.

    A stuck channel keeps its last count.
    """
    p, s = plant[0], sensors[0]
    rotor, shaken, twisted = _shaking(p, s)
    for i in range(3):
        if s.stuck[i] == 0:
            registers[_ACCELEROMETER + i] = accelerometer_count(
                sensed_force(s.accelerometer_matrix, p.specific_force_b, i)
                + s.vibration * rotor[i],
                s.accelerometer_bias[i] + s.warmth * s.accelerometer_warm_up,
                shaken,
                noise[row, i],
                s.accelerometer_range,
            )
        if s.stuck[3 + i] == 0:
            registers[_GYROSCOPE + i] = gyroscope_count(
                _sensed_rate(p, s, i) + s.vibration_gyroscope * rotor[i],
                s.gyroscope_bias[i] + s.warmth * s.gyroscope_warm_up,
                twisted,
                noise[row, 3 + i],
                s.gyroscope_range,
            )
    if s.stuck[STUCK_PRESSURE] == 0:
        pressure = sensed_pressure(p, s, noise, row)
        registers[_PRESSURE] = _count(pressure - PRESSURE_OFFSET, -32768, 32767)
    if s.stuck[STUCK_BATTERY] == 0:
        voltage = p.voltage + _VOLTAGE_NOISE * noise[row, 7]
        registers[_BATTERY] = _count(10.0 * voltage, 0, 32767)
