"""The inertia from every tick of a log, and how it converged (Sec. 5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from flight_log.fields import FORCE, THRUSTS, TURNING_B
from flight_log.run import Series
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

AXES = ("xx", "yy", "zz")
WANTED = {
    "state": TURNING_B,
    "actuators": THRUSTS,
    "status": ("airborne", "behavior"),
    "imu": FORCE,
}
RATE = 0.2
"""How fast the estimate forgets, in 1/s: slower than from one excitation of an axis to the next, or
it ends at what gusts showed meanwhile."""
GUESS = 0.03
"""Initial value of every axis, in kg m², independent of the model's inertia."""
ERROR_MAX = 0.03
"""Largest error, as a share of the truth."""
SPREAD_MAX = 0.02
"""Largest standard deviation in the last third of an excitation, as a share of the estimate."""
TORQUE_MIN = 0.003
"""Filtered torque about an axis, in N m rms, below which noise is as large."""
LATE = 1.0
"""Seconds after the last excitation that still count."""
GAP = 2.5
"""Longest gap between ticks, in periods; after a longer one the filters restart, once the motors'
lag has forgotten the commands within it."""
FORGOTTEN = 5.0
"""Time to forget them, in time constants of the motors."""
EACH = 0.02
"""Seconds between two points of the convergence."""
BOUNDS = ((0.001, 0.1), (0.001, 0.1), (0.001, 0.2))
"""Bounds of model.inertia_…, kg m²."""


@dataclass(frozen=True, slots=True)
class InertiaFlight:
    """The estimate during the excitation.

    Attributes:
        time: (N,) s, vehicle clock.
        inertia_b: (N, 3) kg m².
        learnt_b: (N, 3) s of excitation about each axis until then.
        torque_b: (3,) N m, the largest rms of the filtered torque about each axis.
        missing: share of the ticks that are not in the log.
        truth_b: (3,) kg m²; NaN when unknown.
    """

    time: Array
    inertia_b: Array
    learnt_b: Array
    torque_b: Array
    missing: float
    truth_b: Array
    ticks: int
    parameters: FlownParameters

    @property
    def found_b(self) -> Array:
        """Return the final inertia, (3,) kg m²."""
        found: Array = self.inertia_b[-1]
        return found

    @property
    def spread_b(self) -> Array:
        """Return the standard deviation (3,) over the last third of the excitation about each axis
        and what follows, as a share of the estimate.
        """
        late = self.learnt_b >= 2.0 / 3.0 * self.learnt_b[-1]
        spread: Array = self.inertia_b.std(axis=0, where=late) / self.found_b
        return spread

    @property
    def settled_b(self) -> Array:
        """Return the time (3,) in s from the first excitation until each axis stays within 3 % of
        the truth, or, if it is unknown, of its final value.
        """
        aim = np.where(np.isfinite(self.truth_b), self.truth_b, self.found_b)
        away = np.abs(self.inertia_b / aim - 1.0) > ERROR_MAX
        after = [int(np.flatnonzero(column)[-1]) + 1 if column.any() else 0 for column in away.T]
        late = self.time - self.time[0]
        return np.array([late[k] if k < len(late) else math.inf for k in after])

    def metrics(self) -> dict[str, float]:
        """Return the figures in kg m², shares, s, without unknown ones."""
        error_b = np.abs(self.found_b / self.truth_b - 1.0)
        out = {
            f"inertia_{axis}_kg_m2": float(v) for axis, v in zip(AXES, self.found_b, strict=True)
        }
        out |= {f"error_{axis}_share": float(v) for axis, v in zip(AXES, error_b, strict=True)}
        out |= {
            "error_share": float(error_b.max()),
            "spread_share": float(self.spread_b.max()),
            "within_3_percent_s": float(self.settled_b.max()),
            "torque_rms_min_n_m": float(self.torque_b.min()),
            "missing_share": self.missing,
            "excited_s": float(self.time[-1] - self.time[0]),
        }
        return {name: value for name, value in out.items() if not math.isnan(value)}

    def limits(self) -> dict[str, float]:
        """Return the largest acceptable values."""
        known = {"error_share": ERROR_MAX} if np.isfinite(self.truth_b).all() else {}
        return {**known, "spread_share": SPREAD_MAX}

    def record(self) -> CalibrationRecord:
        """Return the record of the inertia. Raises MeasurementError for an axis that was hardly
        excited, or whose inertia the model does not accept.
        """
        for axis, value, torque, (low, high) in zip(
            AXES, self.found_b, self.torque_b, BOUNDS, strict=True
        ):
            if not torque >= TORQUE_MIN:
                raise MeasurementError(
                    f"the excitation about {axis[0]} was too weak: {1e3 * torque:.1f} mN m rms, "
                    f"{1e3 * TORQUE_MIN:g} mN m are needed; fly larger or quicker steps"
                )
            if not low <= value <= high:
                raise MeasurementError(
                    f"an inertia of {value:.4g} kg m² about {axis[0]} is outside what the "
                    f"model accepts: {low:g} to {high:g} kg m²"
                )
        values = self.parameters.vehicle
        warnings: tuple[str, ...] = ()
        if self.missing > 0.0:
            warnings = (f"{100.0 * self.missing:.2g} % of the ticks are not in the log",)
        each = list(zip("xyz", self.spread_b, self.torque_b, self.settled_b, strict=True))
        return CalibrationRecord(
            name="inertia",
            values={
                f"model.inertia_{axis}": round(float(v), 6)
                for axis, v in zip(AXES, self.found_b, strict=True)
            },
            figures=(
                *(
                    Quality(name=f"torque about {a}, rms", value=t, unit="N m")
                    for a, _, t, _ in each
                ),
                *(
                    Quality(name=f"within 3 % about {a} after", value=min(s, 999.0), unit="s")
                    for a, _, _, s in each
                ),
            ),
            quality=tuple(
                Quality(name=f"spread about {a}, share", value=s, limit=SPREAD_MAX)
                for a, s, _, _ in each
            ),
            warnings=warnings,
            conditions={
                "meaning": "torque commanded over torque needed: the inertia over the thrust "
                "efficiency",
                "motor lag": f"{float(values['model.motor_time_constant']):g} s",
                "first guess": f"{GUESS:g} kg m² about each axis",
                "ticks": str(self.ticks),
            },
        )


def read_inertia(log: Path, vehicle: str) -> InertiaFlight:
    """Read an inertia flight from its log. Raises LogFormatError without the topics,
    MeasurementError when nothing was excited.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED, optional=("imu",))
    start, end = _excited(columns["status"])
    if not end > start:
        raise MeasurementError(f"{log.name}: nothing was excited in flight, so nothing is known")
    state, actuators = columns["state"], columns["actuators"]
    time, first, second = np.intersect1d(state.time, actuators.time, return_indices=True)
    inside = (time >= start) & (time <= end)
    if inside.sum() < 3:
        raise MeasurementError(f"{log.name} has almost no ticks of the excitation")
    rates = np.stack([state.values(name)[first][inside] for name in TURNING_B], 1, dtype=np.float64)
    thrusts = np.stack(
        [actuators.values(name)[second][inside] for name in THRUSTS], 1, dtype=np.float64
    )
    imu, forces = columns["imu"], np.zeros_like(rates)
    if len(imu.time):
        for axis, name in enumerate(FORCE):
            forces[:, axis] = np.interp(time[inside], imu.time, imu.values(name))
    return estimate_inertia(time[inside], rates, thrusts, parameters, forces)


def estimate_inertia(
    time: Array,
    rates_b: Array,
    thrusts: Array,
    parameters: FlownParameters,
    forces_b: Array | None = None,
) -> InertiaFlight:
    """Step the estimator over all ticks; the thrusts of a tick act until the next one.

    Args:
        forces_b: (N, 3) m/s², specific force, which shows the drag's torque; None neglects it.
    """
    # Imported here: it loads a compiler, which the station does not need.
    from estimation.identification.drag_torque import drag_torques
    from estimation.identification.inertia_estimator import InertiaEstimator, InertiaParameters
    from quadrotor.records import ACTUATORS, new_state

    model = {
        name: float(parameters.vehicle[f"model.{name}"])
        for name in ("arm", "torque_ratio", "motor_time_constant")
    }
    estimator = InertiaEstimator(
        np.full(3, GUESS), **model, parameters=InertiaParameters(rate=RATE)
    )
    state, actuators = new_state(), np.zeros(1, ACTUATORS)
    rate_b, thrust = state["angular_velocity_b"][0], actuators["thrusts"][0]
    steps = np.diff(time)
    period = float(np.median(steps))
    drag_b = np.zeros((len(steps), 3))
    if forces_b is not None:
        drag_b = drag_torques(steps, rates_b, thrusts, forces_b, **model)
    points: list[tuple[float, Array, Array]] = []
    next_at = 0.0
    torque_b, forgotten = np.zeros(3), FORGOTTEN * model["motor_time_constant"]
    learns_at = time[0] + forgotten
    for k, dt in enumerate(steps.tolist()):
        rate_b[:], thrust[:] = rates_b[k + 1], thrusts[k]
        if dt > GAP * period:
            learns_at = time[k + 1] + forgotten
        estimator.step(state, actuators, bool(time[k + 1] >= learns_at), dt, drag_b[k])
        if time[k + 1] >= next_at:
            next_at = time[k + 1] + EACH
            points.append((time[k + 1], estimator.inertia_b, estimator.learnt_b))
            torque_b = np.maximum(torque_b, estimator.torque_b)
    points.append((time[-1], estimator.inertia_b, estimator.learnt_b))
    moments, found, learnt = (np.array(one) for one in zip(*points, strict=True))
    lost = float(np.sum(np.maximum(np.rint(steps / period) - 1.0, 0.0)))
    return InertiaFlight(
        moments,
        found,
        learnt_b=learnt,
        torque_b=torque_b,
        missing=lost / (lost + len(time)),
        truth_b=_truth_b(parameters),
        ticks=len(time),
        parameters=parameters,
    )


def _truth_b(parameters: FlownParameters) -> Array:
    """Return what the estimate should find, (3,) kg m²; NaN when unknown."""
    truth = parameters.truth
    inertia_b = np.array([float(truth.get(f"inertia_{axis}", math.nan)) for axis in AXES])
    return inertia_b / float(truth.get("thrust_efficiency", 1.0))


def _excited(status: Series) -> tuple[float, float]:
    """Return the span (s) from the first excitation to shortly after the last, in the air; NaN
    without one.
    """
    flying = status.time[status.values("airborne") > 0.5]
    behaviors = status.changes("behavior")
    begins = [t for t, name in behaviors if name == "excite"]
    if not begins or not len(flying):
        return math.nan, math.nan
    ends = [t for t, name in behaviors if t > begins[-1] and name != "excite"]
    end = ends[0] + LATE if ends else math.inf
    down = [t for t, name in behaviors if t > begins[-1] and name in ("land", "emergency_landing")]
    return begins[0], min(end, float(flying[-1]), *down[:1])
