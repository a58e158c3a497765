"""Gyroscope bias from still samples, at each start (Sec. 5.1 of the paper)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.errors import MeasurementError


class GyroCalibration:
    """Collects N uncorrected samples, then gives their mean or says why not.

    Args:
        samples: N.
        deviation_max: rad/s, largest standard deviation on any axis.
    """

    def __init__(self, samples: int, deviation_max: float) -> None:
        self._buffer = np.empty((samples, 3))
        self._deviation_max = deviation_max
        self._count = 0

    def add(self, angular_velocity_b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64] | None:
        """One sample (3,) in rad/s; the bias (3,) once N are in, else None.

        Raises MeasurementError when the N samples were not still, and starts over.
        """
        self._buffer[self._count] = angular_velocity_b
        self._count += 1
        if self._count < len(self._buffer):
            return None
        self._count = 0
        deviation = self._buffer.std(axis=0).max()
        if deviation > self._deviation_max:
            raise MeasurementError(
                f"gyroscope not calibrated: standard deviation {np.degrees(deviation):.2f} deg/s, "
                f"allowed {np.degrees(self._deviation_max):.2f}; keep the vehicle still"
            )
        mean: npt.NDArray[np.float64] = self._buffer.mean(axis=0)
        return mean
