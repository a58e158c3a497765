"""The residual force and torque of a recorded flight: what was measured less the rotors' model.

Along body axes, with the accelerometer's specific force f, the commanded thrusts behind the rotors'
lag and their wrench (T, tau):

    force    m f - T e_z
    torque   J omega' + omega x J omega - tau

Both are seen through the low pass a / (s + a), through which omega' is a (omega - omega_fil). No
speed of a rotor is needed, and a wind or a bias of a sensor is a constant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from flight_log.fields import FORCE, THRUSTS, TURNING_B, VELOCITY_B
from flight_log.run import Series
from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array
from quadrotor.vehicle_model import mixing_matrix

WANTED = {
    "imu": FORCE,
    "state": (*VELOCITY_B, *TURNING_B),
    "actuators": THRUSTS,
    "status": ("behavior",),
}
NOT_FREE = "ground", "take_off", "land"
"""Behaviors in which the ground or its effect carries the vehicle."""
POLE = 10.0
"""Pole a of the low pass, rad/s."""
SETTLED = 1.0
"""s after take-off that do not count: the low pass has forgotten the ground."""
EVERY = 0.02
"""s between two samples of the residual, which the low pass makes alike."""


@dataclass(frozen=True)
class FlightResidual:
    """The residual of one flight, behind the low pass.

    Attributes:
        name: of the log.
        time: (N,) s.
        velocity_b: (N, 3) m/s.
        thrust: (N,) N, of the rotors' model.
        speed: (N,) mean of the rotors' speeds over its mean.
        force_b: (N, 3) N. torque_b: (N, 3) N m.
        parameters: of the flight.
    """

    name: str
    time: Array
    velocity_b: Array
    thrust: Array
    speed: Array
    force_b: Array
    torque_b: Array
    parameters: FlownParameters

    def rows(self, chosen: npt.NDArray[np.intp]) -> FlightResidual:
        """Return the chosen samples."""
        columns = "time", "velocity_b", "thrust", "speed", "force_b", "torque_b"
        return replace(self, **{name: getattr(self, name)[chosen] for name in columns})


def read_residual(log: Path, vehicle: str) -> FlightResidual:
    """Read the residual of a flight from its log.

    Raises LogFormatError without the topics, MeasurementError when it was never in free flight.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED)
    stamps = [columns[name].time for name in ("imu", "state", "actuators")]
    time = np.intersect1d(np.intersect1d(stamps[0], stamps[1]), stamps[2])
    free = _in_free_flight(columns["status"], time)
    if not free.any():
        raise MeasurementError(f"{log.name} has no free flight: it was on the ground throughout")

    def rows(name: str, fields: tuple[str, ...]) -> Array:
        series = columns[name]
        return series.rows(fields)[np.searchsorted(series.time, time)].astype(np.float64)

    force_b, thrusts = rows("imu", FORCE), rows("actuators", THRUSTS)
    motion_b = rows("state", (*VELOCITY_B, *TURNING_B))
    found = residual(time, force_b, motion_b, thrusts, parameters.vehicle)
    names = "velocity_b", "thrust", "speed", "force_b", "torque_b"
    of_rotors = dict(zip(names, found, strict=True))
    every = max(1, round(EVERY / float(np.median(np.diff(time)))))
    whole = FlightResidual(name=log.stem, time=time, parameters=parameters, **of_rotors)
    return whole.rows(np.flatnonzero(free)[::every])


def residual(
    time: Array,
    force_b: Array,
    motion_b: Array,
    thrusts: Array,
    values: Mapping[str, ParameterValue],
) -> tuple[Array, Array, Array, Array, Array]:
    """Return velocity, thrust, relative speed of the rotors, force and torque as `FlightResidual`
    has them, of N ticks.

    Args:
        force_b: (N, 3) m/s², specific force.
        motion_b: (N, 6) velocity (m/s) and angular velocity (rad/s).
        thrusts: (N, 4) N, commanded from each tick to the next.
        values: parameters of the vehicle.
    """
    mass = float(values["model.mass"])
    mixing = mixing_matrix(float(values["model.arm"]), float(values["model.torque_ratio"]))
    J = np.array([float(values[f"model.inertia_{axis}"]) for axis in ("xx", "yy", "zz")])
    # The lag is linear in the speed of a rotor, of which the thrust is the square.
    speeds = lagged(
        time, np.sqrt(np.maximum(thrusts, 0.0)), float(values["model.motor_time_constant"])
    )
    wrench = speeds**2 @ mixing.T
    thrust, tau_b = wrench[:, 0], wrench[:, 1:]
    omega_b = motion_b[:, 3:]
    carried = mass * force_b
    carried[:, 2] -= thrust
    turned = np.cross(omega_b, J * omega_b) - tau_b
    slow = lagged(
        time, np.column_stack((motion_b, thrust, speeds.mean(axis=1), carried, turned)), 1.0 / POLE
    )
    torque_b = J * POLE * (omega_b - slow[:, 3:6]) + slow[:, 11:]
    return slow[:, :3], slow[:, 6], slow[:, 7] / slow[:, 7].mean(), slow[:, 8:11], torque_b


def lagged(time: Array, values: Array, constant: float) -> Array:
    """Return values (N, k), each held to the next time, behind a lag of first order (s)."""
    found = np.empty_like(values)
    found[0] = values[0]
    for k, share in enumerate((-np.expm1(-np.diff(time) / constant)).tolist()):
        found[k + 1] = found[k] + share * (values[k] - found[k])
    return found


def _in_free_flight(status: Series, time: Array) -> Array:
    """Return for each time whether the vehicle flies free, and has for a while."""
    free = np.zeros(len(time), dtype=bool)
    changes = [*status.changes("behavior"), (np.inf, "")]
    was_free = False
    for (begin, name), (end, _) in pairwise(changes):
        is_free = name not in NOT_FREE
        start = begin if was_free else begin + SETTLED
        free |= is_free & (time >= start) & (time < end)
        was_free = is_free
    return free
