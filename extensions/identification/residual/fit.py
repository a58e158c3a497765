"""Drag by axis, its height over the centre of mass, and loss of thrust by inflow: regressions.

Each direction has one term of the simulator's model (`vehicle.simulator.air`):

    x, y    F = c - d v
    z       F = c - k T v_z
    roll    tau_x = c + h d_y v_y
    pitch   tau_y = c - h d_x v_x

The constants c are each part's own: winds and biases. A part is a flight, or a third of the only
one. A direction is judged by parts that its fit has not seen, and so are the terms that the model
does not have: velocity times its size, and times the rotors' speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from extensions.identification.residual.flights import EVERY, FlightResidual
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

SPEED_MIN = {"x": 0.3, "y": 0.3, "z": 0.08}
"""Lowest rms of the velocity (m/s) along each axis of the body that shows its term."""
RIDGES = 0.0, 1e-3, 1e-2, 1e-1, 1.0
"""Penalties of coefficients per sample, of terms of unit variance; the best on held-out parts is
taken."""
THIRDS = 3
LEAST = 6.0
"""Shortest free flight, s."""


@dataclass(frozen=True)
class Direction:
    """The residual along or about one axis.

    Attributes:
        axis: x, y or z, of the velocity that shows it.
        terms: (parts) of (N, 1 + others), the model's term first. forces: (parts) of (N,).
    """

    name: str
    axis: str
    unit: str
    terms: list[Array]
    forces: list[Array]


@dataclass(frozen=True)
class Found:
    """The coefficient of a direction's term.

    Attributes:
        value: of the model's term. deviation: standard, of the mean over thirds of the flights.
        explained: share of the squared residual of held-out parts that the term explains.
        by_all: the same with the terms that the model does not have. ridge: its penalty.
        rms: of the residual. left: the same without what the term explains.
    """

    name: str
    unit: str
    value: float
    deviation: float
    explained: float
    by_all: float
    ridge: float
    rms: float
    left: float

    @property
    def good(self) -> bool:
        """Return whether it helps on flights that it has not seen, and is clear of zero.

        A force has the sign of drag, while drag may act above or below the centre of mass.
        """
        value = self.value if self.name in SPEED_MIN else abs(self.value)
        return self.explained > 0.0 and value > 2.0 * self.deviation


@dataclass(frozen=True)
class ResidualFit:
    """The terms that were found.

    Attributes:
        found: by the name of the direction.
        quiet: rms velocity (m/s) of the axes that were not excited, along which nothing is known.
    """

    found: dict[str, Found]
    quiet: dict[str, float]
    parts: int

    def simulator(self) -> dict[str, float]:
        """Return the values of the simulator's parameters."""
        terms = {"x": "rotor_drag_x", "y": "rotor_drag_y", "z": "inflow_loss"}
        values = {
            f"simulator.{terms[name]}": one.value
            for name, one in self.found.items()
            if name in terms and one.good
        }
        lever = self._lever()
        return values if lever is None else {**values, "simulator.drag_lever": lever}

    def model(self) -> dict[str, float]:
        """Return the values of the model, which laws feed forward: one drag for both level axes."""
        level = [one.value for name, one in self.found.items() if name in "xy" and one.good]
        if not level:
            return {}
        lever = self._lever()
        return {
            "model.drag": sum(level) / len(level),
            **({} if lever is None else {"model.drag_lever": lever}),
        }

    def _lever(self) -> float | None:
        """Return the drag's height over the centre of mass, m, weighted by what each axis shows."""
        pairs = [
            (self.found[drag].value, turn.value)
            for name, drag in (("roll", "y"), ("pitch", "x"))
            if (turn := self.found.get(name)) and turn.good and self.found[drag].good
        ]
        weight = sum(drag * drag for drag, _ in pairs)
        return sum(drag * turn for drag, turn in pairs) / weight if weight > 0.0 else None


def fit_residual(flights: Sequence[FlightResidual]) -> ResidualFit:
    """Fit the terms of every direction that was excited. Raises MeasurementError for none."""
    speeds = {
        axis: math.sqrt(float(np.mean([one.velocity_b[:, k].var() for one in flights])))
        for k, axis in enumerate(SPEED_MIN)
    }
    quiet = {axis: rms for axis, rms in speeds.items() if not rms >= SPEED_MIN[axis]}
    if len(quiet) == len(speeds):
        told = ", ".join(f"{axis} {rms:.2f} of {SPEED_MIN[axis]:g}" for axis, rms in quiet.items())
        raise MeasurementError(
            f"not excited along any axis of the body (m/s rms: {told}), so no force can be told "
            "from noise; fly the 8, circles or steps"
        )
    seconds = sum(len(one.time) for one in flights) * EVERY
    if seconds < LEAST:
        raise MeasurementError(
            f"{seconds:.1f} s of free flight are too short, {LEAST:g} s are needed"
        )
    is_alone = len(flights) == 1
    parts = split(flights[0], THIRDS) if is_alone else flights
    found = {
        one.name: fitted(one, 1 if is_alone else THIRDS)
        for one in directions(parts)
        if one.axis not in quiet
    }
    return ResidualFit(found, quiet, len(parts))


def split(flight: FlightResidual, number: int) -> list[FlightResidual]:
    """Return a flight in so many parts of equal length."""
    pieces = np.array_split(np.arange(len(flight.time)), number)
    return [flight.rows(one) for one in pieces]


def directions(parts: Sequence[FlightResidual]) -> list[Direction]:
    """Return what is fitted: three forces (N), two torques (N m)."""

    def terms(part: FlightResidual, k: int, sign: float) -> Array:
        v = part.velocity_b[:, k]
        own = v * part.thrust if k == 2 else v
        return sign * np.column_stack((own, v * np.abs(v), v * part.speed))

    def made(name: str, axis: str, unit: str, force: str, k: int, sign: float) -> Direction:
        """Return a direction whose force or torque has the index k."""
        of = "xyz".index(axis)
        return Direction(
            name,
            axis,
            unit,
            [_centred(terms(part, of, sign)) for part in parts],
            [_centred(getattr(part, force)[:, k]) for part in parts],
        )

    return [
        made("x", "x", "N s/m", "force_b", 0, -1.0),
        made("y", "y", "N s/m", "force_b", 1, -1.0),
        made("z", "z", "s/m", "force_b", 2, -1.0),
        made("roll", "y", "N s", "torque_b", 0, 1.0),
        made("pitch", "x", "N s", "torque_b", 1, -1.0),
    ]


def fitted(one: Direction, pieces: int) -> Found:
    """Return the coefficient of a direction's own term, and what it and all terms explain.

    Args:
        pieces: of each part, by whose coefficients the deviation is known.
    """
    own = [terms[:, :1] for terms in one.terms]
    value = float(ridge(own, one.forces, 0.0)[0])
    thirds = [
        (_centred(a), _centred(b))
        for terms, forces in zip(own, one.forces, strict=True)
        for a, b in zip(*(np.array_split(x, pieces) for x in (terms, forces)), strict=True)
    ]
    each = [float(ridge([a], [b], 0.0)[0]) for a, b in thirds]
    by_all = {penalty: explained(one.terms, one.forces, penalty) for penalty in RIDGES}
    best = max(RIDGES, key=by_all.__getitem__)
    forces = np.concatenate(one.forces)
    left = forces - value * np.concatenate(own)[:, 0]
    return Found(
        name=one.name,
        unit=one.unit,
        value=value,
        deviation=float(np.std(each, ddof=1)) / math.sqrt(len(each)),
        explained=explained(own, one.forces, 0.0),
        by_all=by_all[best],
        ridge=best,
        rms=float(np.sqrt(np.mean(forces**2))),
        left=float(np.sqrt(np.mean(left**2))),
    )


def explained(terms: Sequence[Array], forces: Sequence[Array], penalty: float) -> float:
    """Return the share of the squared forces of each part that a fit to the others explains."""
    missed = total = 0.0
    for k in range(len(forces)):
        seen = [n for n in range(len(forces)) if n != k]
        c = ridge([terms[n] for n in seen], [forces[n] for n in seen], penalty)
        missed += float(np.sum((forces[k] - terms[k] @ c) ** 2))
        total += float(np.sum(forces[k] ** 2))
    return 1.0 - missed / total if total > 0.0 else 0.0


def ridge(terms: Sequence[Array], forces: Sequence[Array], penalty: float) -> Array:
    """Return the coefficients (k,) of terms, scaled to unit variance for the penalty."""
    A, b = np.concatenate(terms), np.concatenate(forces)
    scale = np.sqrt(np.mean(A**2, axis=0))
    A = A / np.where(scale > 0.0, scale, 1.0)
    root = math.sqrt(penalty * len(b)) * np.eye(A.shape[1])
    found = np.linalg.lstsq(np.vstack((A, root)), np.append(b, np.zeros(len(root))))[0]
    coefficients: Array = found / np.where(scale > 0.0, scale, 1.0)
    return coefficients


def _centred(values: Array) -> Array:
    centred: Array = values - values.mean(axis=0)
    return centred
