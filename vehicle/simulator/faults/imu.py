"""Faults of the accelerometer and the gyroscope."""

from __future__ import annotations

import math

import numpy as np

from bearing_sim.faults.fault import Memory
from bearing_sim.faults.schedule import Moment
from quadrotor.parameters import parameter
from quadrotor.plain_rotations import matrix_of, quaternion_of
from vehicle.simulator.faults.truth import AXES, SENSORS, Truth, VehicleFault, channel

_MODEL = (
    "I. Skog, P. Händel, Calibration of a MEMS inertial measurement unit, 2006: scale, "
    "misalignment and bias"
)


class Scale(VehicleFault):
    """One axis reads a multiple of what it senses, gravity included."""

    name = "imu.scale"
    source = _MODEL
    of = ("sensor", "axis")

    sensor: str = parameter("accelerometer", choices=SENSORS)
    """sensor that is wrong"""
    axis: str = parameter("z", choices=AXES)
    """body axis"""
    factor: float = parameter(1.05, ge=0.0, le=3.0, step=0.01)
    """read over true value"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        gain = np.ones(3)
        gain[AXES.index(self.axis)] = 1.0 + moment.level * (self.factor - 1.0)
        setattr(truth, self.sensor, gain[:, None] * getattr(truth, self.sensor))


class Misalignment(VehicleFault):
    """The sensor is turned against the body, as after a hard landing."""

    name = "imu.misalignment"
    source = _MODEL
    of = ("sensor",)

    sensor: str = parameter("accelerometer", choices=SENSORS)
    """sensor that is turned"""
    x: float = parameter(2.0, unit="°", ge=-45, le=45, step=0.5)
    """rotation vector of the sensor along x_B"""
    y: float = parameter(0.0, unit="°", ge=-45, le=45, step=0.5)
    """rotation vector of the sensor along y_B"""
    z: float = parameter(0.0, unit="°", ge=-45, le=45, step=0.5)
    """rotation vector of the sensor along z_B"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        x, y, z = (moment.level * math.radians(one) for one in (self.x, self.y, self.z))
        into_sensor = matrix_of(np.array(quaternion_of(x, y, z))).T
        setattr(truth, self.sensor, into_sensor @ getattr(truth, self.sensor))


class Clip(VehicleFault):
    """Readings beyond a range stay at its end, as of a sensor set to a smaller full scale."""

    name = "imu.clip"
    source = "saturation at full scale; definition"

    accelerometer: float = parameter(15.0, unit="m/s²", ge=1, le=200, step=1)
    """largest reading of the accelerometer on each axis"""
    gyroscope: float = parameter(200.0, unit="°/s", ge=1, le=2000, step=10)
    """largest reading of the gyroscope on each axis"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.accelerometer_range = self.accelerometer
        truth.gyroscope_range = math.radians(self.gyroscope)


class Stuck(VehicleFault):
    """One axis keeps its last reading, as when its converter hangs."""

    name = "imu.stuck"
    source = "definition"
    of = ("sensor", "axis")

    sensor: str = parameter("gyroscope", choices=SENSORS)
    """sensor that is stuck"""
    axis: str = parameter("x", choices=AXES)
    """body axis"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.stuck.add(channel(self.sensor, self.axis))


class AccelerometerRamp(VehicleFault):
    """The accelerometer's bias grows at a constant rate, as it does while warming up."""

    name = "imu.accelerometer_ramp"
    source = _MODEL
    varies = True

    x: float = parameter(0.0, unit="m/s³", ge=-1, le=1, step=0.01)
    """rate along x_B"""
    y: float = parameter(0.0, unit="m/s³", ge=-1, le=1, step=0.01)
    """rate along y_B"""
    z: float = parameter(0.05, unit="m/s³", ge=-1, le=1, step=0.01)
    """rate along z_B"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        _grow(truth, "accelerometer_bias", moment, (self.x, self.y, self.z))


class GyroscopeRamp(VehicleFault):
    """The gyroscope's bias grows at a constant rate, as it does while warming up."""

    name = "imu.gyroscope_ramp"
    source = _MODEL
    varies = True

    x: float = parameter(0.2, unit="°/s²", ge=-10, le=10, step=0.1)
    """rate about x_B"""
    y: float = parameter(0.0, unit="°/s²", ge=-10, le=10, step=0.1)
    """rate about y_B"""
    z: float = parameter(0.0, unit="°/s²", ge=-10, le=10, step=0.1)
    """rate about z_B"""

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        _grow(truth, "gyroscope_bias", moment, (self.x, self.y, self.z))


class Gaps(VehicleFault):
    """The microcontroller sends no samples; with `share` or `every` that leaves gaps."""

    name = "imu.gaps"
    source = "definition"

    def act(self, truth: Truth, moment: Moment, memory: Memory) -> None:
        truth.parameters.lost_samples = 1.0


def _grow(truth: Truth, bias: str, moment: Moment, rates: tuple[float, float, float]) -> None:
    for axis, rate in zip(AXES, rates, strict=True):
        before = getattr(truth.parameters, f"{bias}_{axis}")
        setattr(truth.parameters, f"{bias}_{axis}", before + rate * moment.level * moment.elapsed)


IMU: tuple[type[VehicleFault], ...] = (
    *(Scale, Misalignment, Clip, Stuck, AccelerometerRamp, GyroscopeRamp, Gaps),
)
