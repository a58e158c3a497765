"""The body that a tracking system follows, and its pose on the vehicle's body."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from quadrotor.parameters import Parameters, parameter
from quadrotor.plain_rotations import rotate, turned

Array = npt.NDArray[np.float64]


def _offset(axis: str) -> Any:
    return parameter(
        0.0,
        unit="m",
        ge=-0.5,
        le=0.5,
        step=0.001,
        flight_step=0.01,
        description=f"of the tracked body's origin from the IMU, along body {axis}",
    )


def _angle(name: str, limit: float) -> Any:
    return parameter(
        0.0,
        unit="°",
        ge=-limit,
        le=limit,
        step=0.1,
        flight_step=1.0,
        description=f"{name} of the tracked body's axes against the vehicle's body, ZYX",
    )


class TrackedBody(Parameters):
    """Position and attitude of the tracked body in the axes of the vehicle's body."""

    x: float = _offset("x")
    y: float = _offset("y")
    z: float = _offset("z")
    roll: float = _angle("roll", 180.0)
    pitch: float = _angle("pitch", 90.0)
    yaw: float = _angle("yaw", 180.0)

    def tracked(self, position_w: Array, quaternion_wb: Array) -> tuple[Array, Array]:
        """Return the pose of the tracked body on a vehicle with this pose: (3,) m, (4,)."""
        if self.is_vehicle:
            return position_w, quaternion_wb
        lever_w = rotate(quaternion_wb.tolist(), (self.x, self.y, self.z))
        for turn in self._turns():
            quaternion_wb = turned(quaternion_wb, turn)
        return position_w + np.array(lever_w), quaternion_wb

    def vehicle(self, position_w: Array, quaternion_wt: Array) -> tuple[Array, Array]:
        """Return the pose of the vehicle whose tracked body has this pose: (3,) m, (4,)."""
        if self.is_vehicle:
            return position_w, quaternion_wt
        for x, y, z in reversed(self._turns()):
            quaternion_wt = turned(quaternion_wt, (-x, -y, -z))
        lever_w = rotate(quaternion_wt.tolist(), (self.x, self.y, self.z))
        return position_w - np.array(lever_w), quaternion_wt

    @property
    def is_vehicle(self) -> bool:
        """Return whether the tracked body is the vehicle's body itself."""
        return not any((self.x, self.y, self.z, self.roll, self.pitch, self.yaw))

    def _turns(self) -> tuple[tuple[float, float, float], ...]:
        return (
            (0.0, 0.0, math.radians(self.yaw)),
            (0.0, math.radians(self.pitch), 0.0),
            (math.radians(self.roll), 0.0, 0.0),
        )
