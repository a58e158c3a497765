"""One onboard step as one compiled call: the filter's prediction, then the laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from estimation.complementary_filter import predict_one
from extensions.batches.onboard import steer
from quadrotor.compiled import compiled
from quadrotor.records import Record

Array = npt.NDArray[np.float64]
Item = Any
"""One record `array[k]` inside compiled code."""


@compiled(inner=True)
def onboard_one(v: Item, s: Item, imu: Item, t: float, airborne: bool, dt: float) -> None:
    """Step the ONBOARD record v by SETTINGS s, with an IMU_SAMPLE dt (s) after the last."""
    predict_one(v.estimator, imu, s.estimation, dt, v.state)
    steer(v, s, t, airborne, dt)


@compiled
def onboard_step(
    onboard: Record, settings: Record, imu: Record, t: float, airborne: bool, dt: float
) -> None:
    """Run `onboard_one` for Python: records of shape (1,)."""
    onboard_one(onboard[0], settings[0], imu[0], t, airborne, dt)


@compiled
def onboard_steps(
    onboard: Record, settings: Record, imu: Record, thrusts: Array, airborne: bool, dt: float
) -> None:
    """Step through the samples `imu` (N,); writes the thrusts (N, 4) in N of each step."""
    v, s = onboard[0], settings[0]
    for k in range(imu.shape[0]):
        onboard_one(v, s, imu[k], k * dt, airborne, dt)
        for i in range(4):
            thrusts[k, i] = v.actuators.thrusts[i]
