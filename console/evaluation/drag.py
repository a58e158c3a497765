"""The drag coefficient from every tick of a log.

Level, m v' = T z_B + c - D v with the commanded thrust T behind the rotors' lag and a constant c
of wind and misalignment. A low pass a / (s + a) on both sides needs no derivative of v (as in
estimation.mass_estimator): m a (v - v_fil) - (T z_B)_fil = c - D v_fil, solved for D and c by least
squares over both level axes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError

Array = npt.NDArray[np.float64]

ATTITUDE = tuple(f"pose.pose.orientation.{axis}" for axis in "wxyz")
VELOCITY = tuple(f"twist.twist.linear.{axis}" for axis in "xyz")
THRUSTS = tuple(f"thrusts[{k}]" for k in range(4))
WANTED = {"state": (*ATTITUDE, *VELOCITY), "actuators": THRUSTS, "status": ("behavior",)}
RAMP = 3.0
"""s in and out of the circles, which do not count; nor do the filters' first moments."""
POLE = 2.0
"""rad/s, a of the low pass."""
LEAST = 6.0
"""s of circling that are worth a figure."""
SPEED_MIN = 0.4
"""m/s rms, below which it is lost in the noise."""
ERROR_MAX = 0.02
"""N s/m from the truth, where it is known."""
SPREAD_MAX = 0.02
"""N s/m between the thirds of the flight, as standard deviation of their mean."""
PIECES = 3
DRAG_BOUNDS = (0.0, 2.0)
"""N s/m, of model.drag."""


@dataclass(frozen=True, slots=True)
class DragFlight:
    """Return the drag that the circles show.

    Attributes:
        found: N s/m. pieces: (PIECES,) the same of each third of the time.
        speed: m/s rms. constant_w: (2,) N. truth: N s/m; NaN when no one knows.
    """

    found: float
    pieces: Array
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
        """Return the metrics in N s/m, m/s, N, s, without unknown ones."""
        found = {
            "drag_N_s_m": self.found,
            "truth_N_s_m": self.truth,
            "error_N_s_m": abs(self.found - self.truth),
            "spread_N_s_m": self.spread,
            "speed_rms_m_s": self.speed,
            "constant_N": float(np.linalg.norm(self.constant_w)),
            "circled_s": self.seconds,
        }
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def limits(self) -> dict[str, float]:
        """Return the largest values that are good."""
        known = {"error_N_s_m": ERROR_MAX} if math.isfinite(self.truth) else {}
        return {**known, "spread_N_s_m": SPREAD_MAX}

    def record(self) -> CalibrationRecord:
        """Return the record of the coefficient. Raises MeasurementError when the model takes no
        such coefficient.
        """
        low, high = DRAG_BOUNDS
        if not low - SPREAD_MAX <= self.found <= high:
            raise MeasurementError(
                f"a drag of {self.found:.3f} N s/m is none the model takes: {low:g} to {high:g} "
                "N s/m; fly in still air, more laps or a shorter period"
            )
        return CalibrationRecord(
            name="drag",
            values={"model.drag": round(max(low, self.found), 3)},
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
    without circles in it.
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
    # The filters begin in the ramp: where they began is forgotten when it counts.
    inside = (time >= start - RAMP) & (time <= end)
    if inside.sum() < PIECES * 10:
        raise MeasurementError(f"{log.name} has hardly a tick of the circles")

    def table(columns: Series, rows: npt.NDArray[np.intp], names: tuple[str, ...]) -> Array:
        return np.stack([columns.values(name)[rows][inside] for name in names], 1, dtype=np.float64)

    attitude, velocity_b = table(state, first, ATTITUDE), table(state, first, VELOCITY)
    thrusts = table(actuators, second, THRUSTS)
    # Imported here: compiled, and the station starts without a compiler.
    from quadrotor.rotations import quaternion_to_matrix

    R_wb = np.array([quaternion_to_matrix(q) for q in attitude])
    velocity_w = np.einsum("nij,nj->ni", R_wb, velocity_b)
    return estimate_drag(time[inside], velocity_w, R_wb[:, :, 2], thrusts, start, parameters)


def estimate_drag(
    time: Array,
    velocity_w: Array,
    z_b: Array,
    thrusts: Array,
    start: float,
    parameters: FlownParameters,
) -> DragFlight:
    """Estimate the coefficient from N ticks, of which those from `start` (s) on count.

    Args:
        velocity_w: (N, 3) m/s. z_b: (N, 3) the body's z axis in world axes.
        thrusts: (N, 4) N, commanded from each tick to the next.

    Raises MeasurementError when it was flown too slowly.
    """
    values = parameters.vehicle
    mass, lag = float(values["model.mass"]), float(values["model.motor_time_constant"])
    root = np.sqrt(np.maximum(thrusts[0], 0.0))  # linear in the speed of a rotor
    slow_v, slow_f = velocity_w[0, :2].copy(), np.zeros(2)
    slow_f[:] = (root**2).sum() * z_b[0, :2]
    filtered = np.empty((len(time), 4))
    filtered[0] = *slow_v, *slow_f
    for k, dt in enumerate(np.diff(time).tolist()):
        before = (root**2).sum()
        root += -math.expm1(-dt / lag) * (np.sqrt(np.maximum(thrusts[k], 0.0)) - root)
        thrust = 0.5 * (before + (root**2).sum())
        share = -math.expm1(-POLE * dt)
        slow_v += share * (velocity_w[k + 1, :2] - slow_v)
        slow_f += share * (thrust * z_b[k + 1, :2] - slow_f)
        filtered[k + 1] = *slow_v, *slow_f
    rows = time >= start
    speed = float(np.sqrt(np.mean(np.sum(velocity_w[rows, :2] ** 2, axis=1))))
    if not speed >= SPEED_MIN:
        raise MeasurementError(
            f"{speed:.2f} m/s are too slow to show drag, {SPEED_MIN:g} m/s are needed: fly a "
            "larger circle or a shorter period"
        )
    force = mass * POLE * (velocity_w[:, :2] - filtered[:, :2]) - filtered[:, 2:]
    force, slow = force[rows], filtered[rows, :2]
    found, constant_w = _solve(force, slow)
    pieces = [
        _solve(f, v)[0]
        for f, v in zip(np.array_split(force, PIECES), np.array_split(slow, PIECES), strict=True)
    ]
    truth = float(parameters.truth.get("drag", math.nan))
    seconds = float(time[-1] - time[rows][0])
    return DragFlight(found, np.array(pieces), speed, constant_w, seconds, truth, parameters)


def _solve(force: Array, velocity: Array) -> tuple[float, Array]:
    """Return d (N s/m) and c (2,) N of force = c - D velocity, both (N, 2)."""
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
