"""Numbers that are in no message and wanted all the same: angles, world velocities, errors.

Each is stored as a column of its topic. Position m, velocity m/s, angles rad; arrays are (N,).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from quadrotor.plain_rotations import roll_pitch_yaw_of_rows, rotate

Array = npt.NDArray[np.float64]
Column = Callable[[str], npt.NDArray[np.float32]]
Columns = dict[str, Array]

POSITION = tuple(f"pose.pose.position.{axis}" for axis in "xyz")
ROTATION = tuple(f"pose.pose.orientation.{axis}" for axis in "wxyz")
VELOCITY = tuple(f"twist.twist.linear.{axis}" for axis in "xyz")
ODOMETRY = (*POSITION, *ROTATION, *VELOCITY)
REFERENCE = tuple(f"position.{axis}" for axis in "xyz")


def of_odometry(column: Column) -> Columns:
    """Return angles and world-axes velocity of a pose with a twist in body axes."""
    q = np.stack([column(name).astype(float) for name in ROTATION], axis=1)
    velocity_w = rotate(q.T, [column(name).astype(float) for name in VELOCITY])
    found = {f"@velocity.{axis}": part for axis, part in zip("xyz", velocity_w, strict=True)}
    angles = roll_pitch_yaw_of_rows(q).T
    found |= {f"@{name}": one for name, one in zip(("roll", "pitch", "yaw"), angles, strict=True)}
    return found


def tracking(times: Array, state: Column, reference_times: Array, reference: Column) -> Columns:
    """Return state less reference at the state's times; NaN where there is no reference."""
    error = [
        state(one).astype(float) - at(times, reference_times, reference(other))
        for one, other in zip(POSITION, REFERENCE, strict=True)
    ]
    found = {f"@error.{axis}": e for axis, e in zip("xyz", error, strict=True)}
    found["@error.distance"] = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
    yaw = of_odometry(state)["@yaw"] - at(times, reference_times, reference("yaw"))
    found["@error.yaw"] = np.arctan2(np.sin(yaw), np.cos(yaw))
    return found


def to_truth(
    times: Array,
    truth: Column,
    velocity: Columns,
    state_times: Array,
    state: Column,
    state_velocity: Columns,
) -> Columns:
    """Return lengths of the state's errors of position and velocity at the truth's times."""
    position = [
        at(times, state_times, state(name)) - truth(name).astype(float) for name in POSITION
    ]
    speed = [
        at(times, state_times, state_velocity[name]) - velocity[name]
        for name in ("@velocity.x", "@velocity.y", "@velocity.z")
    ]
    return {
        "@position_error": np.sqrt(sum(p * p for p in position)),
        "@velocity_error": np.sqrt(sum(v * v for v in speed)),
    }


def at(times: Array, source_times: Array, values: npt.NDArray[np.floating]) -> Array:
    """Interpolate linearly between the samples of `values`; NaN outside of them."""
    if len(source_times) == 0:
        return np.full(len(times), np.nan)
    if len(times) == len(source_times) and np.array_equal(times, source_times):
        return values.astype(float)
    between: Array = np.interp(times, source_times, values.astype(float), left=np.nan, right=np.nan)
    return between
