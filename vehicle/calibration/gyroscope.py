"""Gyroscope bias from samples at rest, at each start and on request (Sec. 5.1 of the paper)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from estimation.calibration.gyroscope import GyroscopeCalibration, identify_gyroscope


class GyroCalibration:
    """Collector of N samples that returns their bias, or raises the reason why there is none.

    Args:
        samples: N, the number of samples.
        deviation_max: rad/s, largest standard deviation on any axis.
    """

    def __init__(self, samples: int, deviation_max: float) -> None:
        self.deviation_max = deviation_max
        self._buffer = np.empty((samples, 3))
        self._count = 0

    def add(
        self, angular_velocity_b: npt.NDArray[np.float64], *, motors_on: bool = False
    ) -> GyroscopeCalibration | None:
        """Add one sample (3,) in rad/s; return the result once there are N, else None.

        Raises MeasurementError and starts over when motors run or the vehicle moved during the N
        samples.
        """
        if motors_on:
            self._count = 0
            identify_gyroscope(self._buffer[:0], self.deviation_max, motors_on=True)
        self._buffer[self._count] = angular_velocity_b
        self._count += 1
        if self._count < len(self._buffer):
            return None
        self._count = 0
        return identify_gyroscope(self._buffer, self.deviation_max)
