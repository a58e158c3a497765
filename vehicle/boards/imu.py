"""Counts of the inertial sensors to SI units in body axes: Secs. 5.1 and 5.2 of the paper.

    f_b = T (a_m - b),   a_m = scale g (counts - zero)        accelerometer, Sec. 5.2
    omega_b = scale (counts - zero) - drift                   gyroscope, Sec. 5.1

T (3, 3) contains rotation and scale of the mounting, b is the accelerometer's bias; both are
identified once. The gyroscope's drift is found again at each start and is not a parameter.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled, direct
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import IMU_SAMPLE, Record
from quadrotor.vehicle_model import GRAVITY
from vehicle.boards.board import RawSample

CALIBRATION = np.dtype(
    [
        ("accelerometer_scale", "f8"),  # m/s^2 per count
        ("accelerometer_zero", "f8"),  # counts
        ("accelerometer_matrix", "f8", (3, 3)),  # T
        ("accelerometer_bias", "f8", 3),  # b, m/s^2, sensor axes
        ("gyroscope_scale", "f8"),  # rad/s per count
        ("gyroscope_zero", "f8"),  # counts
        ("gyroscope_bias_b", "f8", 3),  # rad/s
    ],
    align=True,
)


def _matrix_entry(default: float, entry: str) -> float:
    value: float = parameter(
        default,
        ge=-1.5,
        le=1.5,
        step=0.0001,
        flight_step=0.02,
        description=f"entry {entry} of T in Sec. 5.2: mounting and scale of the accelerometer",
    )
    return value


def _accelerometer_bias(axis: str) -> float:
    value: float = parameter(
        0.0,
        unit="m/s²",
        ge=-3.0,
        le=3.0,
        step=0.001,
        flight_step=0.2,
        description=f"accelerometer bias b in Sec. 5.2 along its {axis} axis",
    )
    return value


class ImuCalibration(Parameters):
    """Calibration from the microcontroller's counts to specific force and angular velocity."""

    accelerometer_scale: float = parameter(
        0.0039, unit="g", ge=0.0001, le=0.1, flight_step=0.0001, step=1e-05
    )
    """specific force per count of the accelerometer"""
    accelerometer_zero: float = parameter(
        512.0, unit="count", ge=0.0, le=1023.0, flight_step=5.0, step=0.1
    )
    """accelerometer reading in free fall"""
    accelerometer_xx: float = _matrix_entry(1.0, "xx")
    accelerometer_xy: float = _matrix_entry(0.0, "xy")
    accelerometer_xz: float = _matrix_entry(0.0, "xz")
    accelerometer_yx: float = _matrix_entry(0.0, "yx")
    accelerometer_yy: float = _matrix_entry(1.0, "yy")
    accelerometer_yz: float = _matrix_entry(0.0, "yz")
    accelerometer_zx: float = _matrix_entry(0.0, "zx")
    accelerometer_zy: float = _matrix_entry(0.0, "zy")
    accelerometer_zz: float = _matrix_entry(1.0, "zz")
    accelerometer_bias_x: float = _accelerometer_bias("x")
    accelerometer_bias_y: float = _accelerometer_bias("y")
    accelerometer_bias_z: float = _accelerometer_bias("z")
    gyroscope_scale: float = parameter(
        0.586, unit="°/s", ge=0.001, le=10.0, flight_step=0.02, step=0.001
    )
    """angular velocity per count of the gyroscope"""
    gyroscope_zero: float = parameter(
        512.0, unit="count", ge=0.0, le=1023.0, flight_step=1.0, step=0.1
    )
    """nominal gyroscope reading at rest; the drift about it is found at each start"""

    def record(self) -> Record:
        """Return the calibration as one CALIBRATION record, shape (1,), without gyroscope drift."""
        out = np.zeros(1, CALIBRATION)
        out["accelerometer_scale"] = self.accelerometer_scale * GRAVITY
        out["accelerometer_zero"] = self.accelerometer_zero
        out["accelerometer_matrix"] = [
            [self.accelerometer_xx, self.accelerometer_xy, self.accelerometer_xz],
            [self.accelerometer_yx, self.accelerometer_yy, self.accelerometer_yz],
            [self.accelerometer_zx, self.accelerometer_zy, self.accelerometer_zz],
        ]
        out["accelerometer_bias"] = (
            self.accelerometer_bias_x,
            self.accelerometer_bias_y,
            self.accelerometer_bias_z,
        )
        out["gyroscope_scale"] = math.radians(self.gyroscope_scale)
        out["gyroscope_zero"] = self.gyroscope_zero
        return out


@compiled
def _apply(
    stamp_ns: int,
    accelerometer: tuple[int, int, int],
    gyroscope: tuple[int, int, int],
    calibration: Record,
    sample: Record,
) -> None:
    c = calibration[0]
    out = sample[0]
    out.stamp_ns = stamp_ns
    force, zero = c.accelerometer_scale, c.accelerometer_zero
    x = force * (accelerometer[0] - zero) - c.accelerometer_bias[0]
    y = force * (accelerometer[1] - zero) - c.accelerometer_bias[1]
    z = force * (accelerometer[2] - zero) - c.accelerometer_bias[2]
    for i in range(3):
        T = c.accelerometer_matrix[i]
        out.specific_force_b[i] = T[0] * x + T[1] * y + T[2] * z
        rate = c.gyroscope_scale * (gyroscope[i] - c.gyroscope_zero)
        out.angular_velocity_b[i] = rate - c.gyroscope_bias_b[i]


class ImuCalibrator:
    """The calibration in use: the parameters, and the gyroscope drift found at the start."""

    def __init__(self, parameters: ImuCalibration) -> None:
        self.gyroscope_bias_b = np.zeros(3)
        """The drift (3,) in use, rad/s, body axes."""
        self.configure(parameters)
        counts, sample = (0, 0, 0), np.zeros(1, IMU_SAMPLE)
        self._apply = direct(_apply, 0, counts, counts, self._calibration, sample)

    def configure(self, parameters: ImuCalibration) -> None:
        """Set new parameters, keeping the gyroscope drift found at the start."""
        self._calibration = parameters.record()
        self._calibration["gyroscope_bias_b"] = self.gyroscope_bias_b

    def set_gyroscope_bias(self, bias_b: npt.NDArray[np.float64]) -> None:
        """Set the gyroscope drift: the mean (3,) of samples at rest, rad/s, body axes."""
        self.gyroscope_bias_b = np.array(bias_b, dtype=np.float64)
        self._calibration["gyroscope_bias_b"] = self.gyroscope_bias_b

    def calibrate(self, raw: RawSample, sample: Record) -> None:
        """Write the IMU_SAMPLE of a raw sample into `sample`, shape (1,)."""
        self._apply(raw.stamp_ns, raw.accelerometer, raw.gyroscope, self._calibration, sample)
