"""The evaluation of the mass estimate from a log: its convergence, and its noise afterwards."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from console.evaluation.log_columns import FlownParameters, read_columns, read_parameters
from console.evaluation.mean_error import mean_error
from console.evaluation.world import gusts_of
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

WANTED = {"estimator": ("mass", "mass_variance", "estimator"), "status": ("airborne", "behavior")}
DEVIATION_MAX = 0.002
"""Largest standard deviation, in kg, of a converged estimate in a hover."""
ERROR_MAX = 0.01
"""Largest error as a share of the truth, flown on full sensors."""
MEAN_ERROR_MAX = ERROR_MAX / 3.0
"""Largest standard error of the mean in erratic flight, as a share of it. Gusts make the estimate
vary without making its mean wrong."""
WITHIN = 0.01
WITHIN_MAX = 3.0
"""Share of the mass, and longest time in s from lift-off until the estimate stays within it."""
LEAST = 5.0
"""Shortest erratic flight, in s, for a result."""
SLICES = 6
MASS_BOUNDS = (0.5, 2.4)
"""Bounds of model.mass, kg."""


@dataclass(frozen=True, slots=True)
class MassFlight:
    """The estimate at its 50 Hz, from take-off to landing.

    Attributes:
        time: (N,) s, vehicle clock.
        mass, deviation: (N,) kg.
        take_off, lift_off, landing: s; NaN when it did not happen.
        erratic: start and end, s, of the erratic flight; NaN when there was none.
        truth: kg, what the estimate should find; NaN when unknown.
    """

    time: Array
    mass: Array
    deviation: Array
    take_off: float
    lift_off: float
    landing: float
    erratic: tuple[float, float]
    truth: float
    estimator: str
    parameters: FlownParameters

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """Return the rows (N,) whose mean is the mass: the erratic flight, else the end of the
        hover.
        """
        start, end = self.erratic
        if not end - start >= LEAST:
            end = self.landing if math.isfinite(self.landing) else float(self.time[-1])
            start = end - LEAST
        return (self.time >= start) & (self.time <= end) & (self.time > self.lift_off)

    @property
    def found(self) -> float:
        """Return the estimated mass, kg."""
        return float(self.mass[self.judged].mean())

    @property
    def spread(self) -> float:
        """Return the standard deviation of the estimate in erratic flight, kg; NaN when there was
        none.
        """
        start, end = self.erratic
        return float(self.mass[self.judged].std()) if end - start >= LEAST else math.nan

    @property
    def mean_error(self) -> float:
        """Return the standard error of `found`, kg."""
        return mean_error(self.mass[self.judged])

    @property
    def settled(self) -> float:
        """Return the seconds from lift-off until the estimate stays within 1 % of the truth, or, if
        it is unknown, of its final value.
        """
        aim = self.truth if math.isfinite(self.truth) else self.found
        rows = (self.time >= self.lift_off) & (self.time <= self.time[self.judged][-1])
        away = np.flatnonzero(np.abs(self.mass[rows] / aim - 1.0) > WITHIN)
        if not len(away):
            return 0.0
        after = away[-1] + 1
        time = self.time[rows]
        return float(time[after] - self.lift_off) if after < len(time) else math.inf

    def metrics(self) -> dict[str, float]:
        """Return the figures in kg, s, shares, without unknown ones."""
        found = {
            "mass_kg": self.found,
            "truth_kg": self.truth,
            "error_share": abs(self.found / self.truth - 1.0),
            "erratic_std_kg": self.spread,
            "mean_error_share": self.mean_error / self.found,
            "deviation_kg": float(self.deviation[self.judged][-1]),
            "lift_off_s": self.lift_off - self.take_off,
            "within_1_percent_s": self.settled,
            "erratic_s": self.erratic[1] - self.erratic[0],
        }
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def limits(self) -> dict[str, float]:
        """Return the largest acceptable values."""
        known = {"error_share": ERROR_MAX} if math.isfinite(self.truth) else {}
        limits = {**known, "mean_error_share": MEAN_ERROR_MAX, "within_1_percent_s": WITHIN_MAX}
        return gusts_of(self.parameters.truth).widened(limits)

    def record(self) -> CalibrationRecord:
        """Return the record of the mass. Raises MeasurementError when the model does
        not accept it.
        """
        low, high = MASS_BOUNDS
        if not low <= self.found <= high:
            raise MeasurementError(
                f"a mass of {self.found:.3f} kg is outside what the model accepts: {low:g} to "
                f"{high:g} kg"
            )
        rows = self.judged
        warnings = () if self.spread < math.inf else ("not flown around: the mean is of the hover",)
        values = self.parameters.vehicle
        return CalibrationRecord(
            name="mass",
            values={"model.mass": round(self.found, 4)},
            figures=tuple(
                Quality(name=name, value=value, unit=unit)
                for name, value, unit in (
                    ("mass of the model", float(values["model.mass"]), "kg"),
                    ("lift-off after", self.lift_off - self.take_off, "s"),
                    ("standard deviation", float(self.mass[rows].std()), "kg"),
                )
                if math.isfinite(value)
            ),
            quality=(
                Quality(
                    name="standard error of the mean, share",
                    value=self.mean_error / self.found,
                    limit=MEAN_ERROR_MAX,
                ),
                Quality(
                    name="within 1 % after",
                    value=min(self.settled, 999.0),
                    unit="s",
                    limit=WITHIN_MAX,
                ),
            ),
            residuals=self._residuals(),
            warnings=warnings,
            conditions={
                "meaning": "thrust commanded over thrust needed: the mass over the thrust "
                "efficiency",
                "samples": str(int(rows.sum())),
                "first guess": f"{self.mass[self.time <= self.lift_off][-1:].sum():.3g} kg",
                "estimator": self.estimator,
            },
        )

    def _residuals(self) -> tuple[tuple[str, float], ...]:
        """Return the deviations of the estimate's mean in slices of what is judged, kg."""
        times = np.array_split(self.time[self.judged], SLICES)
        masses = np.array_split(self.mass[self.judged], SLICES)
        begin = float(times[0][0])
        return tuple(
            (f"{t[0] - begin:.0f} to {t[-1] - begin:.0f} s, kg", float(m.mean() - self.found))
            for t, m in zip(times, masses, strict=True)
            if len(t)
        )


def read_mass(log: Path, vehicle: str) -> MassFlight:
    """Read a mass flight from its log. Raises LogFormatError without the topics, MeasurementError
    when the vehicle never left the ground.
    """
    parameters = read_parameters(log)
    columns = read_columns(log, vehicle, WANTED)
    estimator, status = columns["estimator"], columns["status"]
    flying = status.time[status.values("airborne") > 0.5]
    if not len(flying):
        raise MeasurementError(
            f"{log.name}: the vehicle never left the ground, so nothing is known"
        )
    lift_off = float(flying[0])
    if not (estimator.time > lift_off).any():
        raise MeasurementError(f"{log.name} has no estimate of the mass from the flight")
    names = estimator.changes("estimator")
    behaviors = status.changes("behavior")
    return MassFlight(
        estimator.time,
        estimator.values("mass").astype(float),
        deviation=np.sqrt(estimator.values("mass_variance").astype(float)),
        take_off=_first(behaviors, "take_off"),
        lift_off=lift_off,
        landing=_first(behaviors, "land", "emergency_landing"),
        erratic=_stretch(behaviors, float(flying[-1])),
        truth=_truth(parameters),
        estimator=names[-1][1] if names else "",
        parameters=parameters,
    )


def _first(behaviors: list[tuple[float, str]], *names: str) -> float:
    """Return the first time (s) at which the behavior is one of `names`; NaN when it never is."""
    return next((time for time, name in behaviors if name in names), math.nan)


def _stretch(behaviors: list[tuple[float, str]], end: float) -> tuple[float, float]:
    """Return the first period in velocity flight (s); NaN when there was none."""
    for k, (time, name) in enumerate(behaviors):
        if name == "velocity":
            return time, behaviors[k + 1][0] if k + 1 < len(behaviors) else end
    return math.nan, math.nan


def _truth(parameters: FlownParameters) -> float:
    """Return the true mass (kg), as thrust commanded over thrust needed; NaN when unknown."""
    truth = parameters.truth
    if "mass" not in truth:
        return math.nan
    mass = float(truth["mass"]) + float(truth.get("payload", 0.0))
    return mass / float(truth.get("thrust_efficiency", 1.0))
