"""Sweeps that the planes of two Lighthouse base stations measure on a level vehicle."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from estimation.sweep_angles import plane_numbers, swept
from quadrotor.records import SWEEPS_SAMPLE, Record

Array = npt.NDArray[np.float64]

SIGMA = 3e-4
SENSORS_B = np.array([[x, y, 0.0] for x in (-0.015, 0.015) for y in (0.0075, -0.0075)])
STATIONS_W = np.array([[-2.6, -0.3, 3.1], [0.4, -3.1, 3.2]])


def sweeps_of(
    number: int, stamp_ns: int, position_w: Array, rng: np.random.Generator, *, sensors: int = 4
) -> Record:
    """Return the sweeps of a plane (two a station, both tilted) on a level vehicle."""
    frame = np.zeros(1, SWEEPS_SAMPLE)
    station = STATIONS_W[number // 2]
    axis = -station / np.linalg.norm(station)
    yaw, pitch = math.atan2(axis[1], axis[0]), math.asin(-axis[2])
    a, b, c, d = (f(0.5 * angle) for angle in (yaw, pitch) for f in (math.cos, math.sin))
    plane = frame["plane"]
    plane["origin_w"], plane["quaternion_wr"] = station, (a * c, -b * d, a * d, b * c)
    plane["tilt"] = (-1 + 2 * (number % 2)) * math.pi / 6 + 0.01
    plane["phase"], plane["gib_magnitude"], plane["gib_phase"] = 0.02, 0.004, 1.3
    plane["curve"] = 0.003
    frame["stamp_ns"], frame["number"], frame["sigma"], frame["count"] = (
        stamp_ns,
        number,
        SIGMA,
        sensors,
    )
    frame["sensor_b"][0, :sensors] = SENSORS_B[:sensors]
    for k in range(sensors):
        x, y, z = position_w + SENSORS_B[k]
        frame["angle"][0, k] = swept(plane_numbers(frame[0]), (x, y, z))[0] + SIGMA * rng.normal()
    return frame
