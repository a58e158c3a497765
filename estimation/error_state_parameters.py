"""The noise that the error-state filter assumes, and its gate.

`estimation.parameters.noise_record` converts all parameters to a record.
"""

from __future__ import annotations

import numpy as np

from quadrotor.parameters import Parameters, parameter

ERROR_STATE_NOISE = np.dtype(
    [
        ("accelerometer_noise", "f8"),  # m/s^2/sqrt(Hz)
        ("gyroscope_noise", "f8"),  # rad/s/sqrt(Hz)
        ("accelerometer_bias_walk", "f8"),  # m/s^2/sqrt(s)
        ("gyroscope_bias_walk", "f8"),  # rad/s/sqrt(s)
        ("pose_position_sigma", "f8"),  # m
        ("pose_attitude_sigma", "f8"),  # rad
        ("bearing_sigma_floor", "f8"),  # rad
        ("sweep_plane_sigma", "f8"),  # rad
        ("gate", "f8"),  # standard deviations
        ("heading", "f8"),  # rad
        ("marker_x", "f8"),  # m
        ("marker_y", "f8"),  # m
        ("marker_z", "f8"),  # m
        ("rate_low_pass", "f8"),  # Hz
        ("rate_notch", "f8"),  # Hz
        ("rate_notch_width", "f8"),  # Hz
        ("accelerometer_bias_limit", "f8"),  # m/s^2
        ("gyroscope_bias_limit", "f8"),  # rad/s
    ],
    align=True,
)


class ErrorStateParameters(Parameters):
    """Noise and gate. Defaults: the laboratory's IMU with its quantisation, a tracker of 1 mm and
    0.2 deg.
    """

    accelerometer_noise: float = parameter(0.0035, unit="m/s²/√Hz", ge=1e-05, le=1.0, step=0.0005)
    """white noise of the accelerometer, vibration included"""
    gyroscope_noise: float = parameter(0.02, unit="°/s/√Hz", ge=1e-05, le=5.0, step=0.005)
    """white noise of the gyroscope, vibration included"""
    accelerometer_bias_walk: float = parameter(0.001, unit="m/s²/√s", ge=0.0, le=0.5, step=0.001)
    """random walk of the accelerometer bias"""
    gyroscope_bias_walk: float = parameter(0.005, unit="°/s/√s", ge=0.0, le=5.0, step=0.005)
    """random walk of the gyroscope bias"""
    pose_position_sigma: float = parameter(0.0015, unit="m", ge=1e-05, le=1.0, step=0.0005)
    """standard deviation of a tracker's position on each axis"""
    pose_attitude_sigma: float = parameter(0.3, unit="°", ge=0.001, le=30.0, step=0.05)
    """standard deviation of a tracker's attitude on each axis"""
    bearing_sigma_floor: float = parameter(0.1, unit="°", ge=0.001, le=10.0, step=0.05)
    """least deviation taken for a bearing, whatever its sender claims"""
    sweep_plane_sigma: float = parameter(0.0, unit="°", ge=0.0, le=5.0, step=0.01)
    """deviation common to the angles of one sweep, by place and calibration of its base station"""
    gate: float = parameter(4.0, ge=2.0, le=20.0, step=0.5)
    """standard deviations beyond which a bearing or pose is an outlier"""
    heading: float = parameter(0.0, unit="°", ge=-180.0, le=180.0, step=5.0)
    """a marker alone: yaw of the vehicle when it is armed, within 10 deg"""
    marker_x: float = parameter(0.0, unit="m", ge=-1.0, le=1.0, step=0.001)
    """a marker alone: where it is, in body axes, forward of the IMU"""
    marker_y: float = parameter(0.0, unit="m", ge=-1.0, le=1.0, step=0.001)
    """a marker alone: where it is, in body axes, left of the IMU"""
    marker_z: float = parameter(0.0, unit="m", ge=-1.0, le=1.0, step=0.001)
    """a marker alone: where it is, in body axes, above the IMU"""


DEGREES = (
    "gyroscope_noise",
    "gyroscope_bias_walk",
    "pose_attitude_sigma",
    "bearing_sigma_floor",
    "sweep_plane_sigma",
    "heading",
)
"""Parameters given in degrees; the record holds radians."""
