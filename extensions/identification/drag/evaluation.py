"""The drag coefficient from every tick of a log.

For level motion, m v' = T z_B + c - D v with the commanded thrust T after the rotors' lag and a
constant c for wind and misalignment. A low pass a / (s + a) on both sides avoids the derivative of
v (as in estimation.identification.mass_estimator): m a (v - v_fil) - (T z_B)_fil = c - D v_fil,
solved for D and c by least squares over both level axes.

For the torque, along body axes, J a (omega - omega_fil) - tau_fil = c + h D (v_y, -v_x)_fil gives
h, the height above the centre of mass at which the drag acts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from flight_log.fields import ATTITUDE, THRUSTS, TURNING_B, VELOCITY_B
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array

TURNING = TURNING_B[:2]
WANTED = {
    "state": (*ATTITUDE, *VELOCITY_B, *TURNING),
    "actuators": THRUSTS,
    "status": ("behavior",),
}
RAMP = 3.0
"""Seconds at the start and end of the circles that do not count; nor does the filters' settling."""
POLE = 2.0
"""Pole a of the low pass, rad/s."""
LEAST = 6.0
"""Shortest time of circling, in s, for a result."""
SPEED_MIN = 0.4
"""Lowest rms speed, in m/s; below it the drag is lost in the noise."""
ERROR_MAX = 0.02
"""Largest error in N s/m to the truth, where it is known."""
SPREAD_MAX = 0.02
"""Largest standard deviation, in N s/m, of the mean of the thirds of the flight."""
PIECES = 3
DRAG_BOUNDS = (0.0, 2.0)
"""Bounds of model.drag, N s/m."""
DRAG_LEAST = 0.05
"""Drag in N s/m below which its point of action is unknown."""
LEVER_BOUNDS = (-0.1, 0.3)
"""Bounds of model.drag_lever, m."""


@dataclass(frozen=True, slots=True)
class DragFlight:
    """The drag that was identified from the circles.

    Attributes:
        found: N s/m.
        pieces: (PIECES,) the same for each third of the time.
        lever: m.
        speed: m/s rms.
        constant_w: (2,) N.
        truth: N s/m; NaN when unknown.
    """

    found: float
    pieces: Array
    lever: float
    speed: float
    constant_w: Array
    seconds: float
    truth: float
    parameters: FlownParameters

    @property
    def spread(self) -> float:
        """Return the standard deviation of the mean of the pieces, N s/m."""
        return float(self.pieces.std(ddof=1)) / math.sqrt(PIECES)

    def metrics(self) -> dict[str, float]:
        """Return the figures in N s/m, m/s, N, s, without unknown ones."""
        found = {
            "drag_N_s_m": self.found,
            "lever_m": self.lever,
            "truth_N_s_m": self.truth,
            "error_N_s_m": abs(self.found - self.truth),
            "spread_N_s_m": self.spread,
            "speed_rms_m_s": self.speed,
            "constant_N": float(np.linalg.norm(self.constant_w)),
            "circled_s": self.seconds,
        }
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def limits(self) -> dict[str, float]:
        """Return the largest acceptable values."""
        known = {"error_N_s_m": ERROR_MAX} if math.isfinite(self.truth) else {}
        return {**known, "spread_N_s_m": SPREAD_MAX}

    def record(self) -> CalibrationRecord:
        """Return the record of the coefficient. Raises MeasurementError when the model does not
        accept it.
        """
        low, high = DRAG_BOUNDS
        if not low - SPREAD_MAX <= self.found <= high:
            raise MeasurementError(
                f"a drag of {self.found:.3f} N s/m is outside what the model accepts: {low:g} "
                f"to {high:g} N s/m; fly in still air, more laps or a shorter period"
            )
        return CalibrationRecord(
            name="drag",
            values={
                "model.drag": round(max(low, self.found), 3),
                "model.drag_lever": round(self.lever, 3),
            },
            figures=(
                Quality(
                    name="drag of the model",
                    unit="N s/m",
                    value=float(self.parameters.vehicle.get("model.drag", 0.0)),
                ),
                Quality(name="speed, rms", value=self.speed, unit="m/s"),
                Quality(
                    name="constant force", value=float(np.linalg.norm(self.constant_w)), unit="N"
                ),
            ),
            quality=(
                Quality(
                    name="standard deviation", value=self.spread, unit="N s/m", limit=SPREAD_MAX
                ),
            ),
            residuals=tuple(
                (f"part {k + 1}, N s/m", float(one - self.found))
                for k, one in enumerate(self.pieces)
            ),
            conditions={
                "meaning": "linear drag of the whole vehicle, level, at the speed flown",
                "circled": f"{self.seconds:.1f} s",
            },
        )


def read_drag(log: Path, vehicle: str) -> DragFlight:
    """Read a drag flight from its log. Raises LogFormatError without the topics, MeasurementError
    when it has no circles.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED)
    start, end = _circled(columns["status"])
    if not end - start >= LEAST:
        raise MeasurementError(
            f"{log.name}: less than {LEAST:g} s of steady circles were flown, so nothing is known"
        )
    state, actuators = columns["state"], columns["actuators"]
    time, first, second = np.intersect1d(state.time, actuators.time, return_indices=True)
    # The filters start in the ramp; their initial values have decayed when the circles count.
    inside = (time >= start - RAMP) & (time <= end)
    if inside.sum() < PIECES * 10:
        raise MeasurementError(f"{log.name} has almost no ticks of the circles")

    def table(columns: Series, rows: npt.NDArray[np.intp], names: tuple[str, ...]) -> Array:
        return np.stack([columns.values(name)[rows][inside] for name in names], 1, dtype=np.float64)

    attitude, velocity_b = table(state, first, ATTITUDE), table(state, first, VELOCITY_B)
    omega_b = table(state, first, TURNING)
    thrusts = table(actuators, second, THRUSTS)
    # Imported here: it is compiled, and the station starts without a compiler.
    from quadrotor.rotations import quaternion_to_matrix

    R_wb = np.array([quaternion_to_matrix(q) for q in attitude])
    velocity_w = np.einsum("nij,nj->ni", R_wb, velocity_b)
    motion_b = np.hstack((velocity_b[:, :2], omega_b))
    return estimate_drag(
        time[inside],
        velocity_w,
        z_b=R_wb[:, :, 2],
        motion_b=motion_b,
        thrusts=thrusts,
        start=start,
        parameters=parameters,
    )


def estimate_drag(
    time: Array,
    velocity_w: Array,
    z_b: Array,
    motion_b: Array,
    thrusts: Array,
    start: float,
    parameters: FlownParameters,
) -> DragFlight:
    """Estimate the coefficient from N ticks, of which those from `start` (s) on count.

    Args:
        velocity_w: (N, 3) m/s.
        z_b: (N, 3) the body's z axis in world axes.
        motion_b: (N, 4) velocity (m/s) and angular velocity (rad/s) along body x and y.
        thrusts: (N, 4) N, commanded from each tick to the next.

    Raises MeasurementError when the flight was too slow.
    """
    values = parameters.vehicle
    mass = float(values["model.mass"])
    filtered = _filtered(
        time, np.hstack((velocity_w[:, :2], z_b[:, :2], motion_b)), thrusts, values
    )
    rows = time >= start
    speed = float(np.sqrt(np.mean(np.sum(velocity_w[rows, :2] ** 2, axis=1))))
    if not speed >= SPEED_MIN:
        raise MeasurementError(
            f"{speed:.2f} m/s are too slow to show drag, {SPEED_MIN:g} m/s are needed: fly a "
            "larger circle or a shorter period"
        )
    inertia = np.array([float(values["model.inertia_xx"]), float(values["model.inertia_yy"])])
    force = mass * POLE * (velocity_w[:, :2] - filtered[:, :2]) - filtered[:, 2:4]
    torque = inertia * POLE * (motion_b[:, 2:] - filtered[:, 6:8]) - filtered[:, 8:]
    force, slow = force[rows], filtered[rows, :2]
    found, constant_w = _solve(force, slow)
    # h D (v_y, -v_x) is the drag of (-v_y, v_x).
    twist, _ = _solve(torque[rows], filtered[rows][:, (5, 4)] * (-1.0, 1.0))
    lever = min(LEVER_BOUNDS[1], max(LEVER_BOUNDS[0], twist / found)) if found > DRAG_LEAST else 0.0
    pieces = [
        _solve(f, v)[0]
        for f, v in zip(np.array_split(force, PIECES), np.array_split(slow, PIECES), strict=True)
    ]
    rotors = [float(parameters.truth.get(f"rotor_drag_{axis}", 0.0)) for axis in "xy"]
    truth = float(parameters.truth.get("drag", math.nan)) + 0.5 * sum(rotors)
    seconds = float(time[-1] - time[rows][0])
    return DragFlight(
        found,
        np.array(pieces),
        lever=lever,
        speed=speed,
        constant_w=constant_w,
        seconds=seconds,
        truth=truth,
        parameters=parameters,
    )


def _filtered(
    time: Array, motion: Array, thrusts: Array, values: Mapping[str, ParameterValue]
) -> Array:
    """Return the low pass (N, 10) of level velocity, thrust force, `motion_b` and torque.

    Args:
        motion: (N, 8) level velocity and the body's z axis along world x and y, `motion_b`.
    """
    lag, arm = float(values["model.motor_time_constant"]), float(values["model.arm"])
    root = np.sqrt(np.maximum(thrusts[0], 0.0))  # linear in the speed of a rotor

    def acting(k: int, f: Array) -> Array:
        """Return the filters' input at tick k, for rotor thrusts f (N)."""
        torque_b = arm * (f[1] - f[3]), arm * (f[2] - f[0])
        return np.concatenate((motion[k, :2], f.sum() * motion[k, 2:4], motion[k, 4:], torque_b))

    slow = acting(0, root**2)
    filtered = np.empty((len(time), len(slow)))
    filtered[0] = slow
    for k, dt in enumerate(np.diff(time).tolist()):
        before = root**2
        root += -math.expm1(-dt / lag) * (np.sqrt(np.maximum(thrusts[k], 0.0)) - root)
        slow += -math.expm1(-POLE * dt) * (acting(k + 1, 0.5 * (before + root**2)) - slow)
        filtered[k + 1] = slow
    return filtered


def _solve(force: Array, velocity: Array) -> tuple[float, Array]:
    """Return d (N s/m) and c (2,) N of force = c - d velocity, both (N, 2)."""
    c = force.mean(axis=0)
    v = velocity - velocity.mean(axis=0)
    drag = -float(np.sum(v * (force - c)) / np.sum(v * v))
    return drag, c + drag * velocity.mean(axis=0)


def _circled(status: Series) -> tuple[float, float]:
    """Return start and end (s) of the circles without their ramps; NaN when none were flown."""
    behaviors = status.changes("behavior")
    for k, (begin, name) in enumerate(behaviors):
        if name == "follow_trajectory":
            end = behaviors[k + 1][0] if k + 1 < len(behaviors) else float(status.time[-1])
            return begin + RAMP, end - RAMP
    return math.nan, math.nan
