"""Results of the arena, stored as JSON: errors with intervals, and who is first how often."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from quadrotor.errors import StorageError, os_errors
from quadrotor.records import Array

RESAMPLED = 2000
NEAR = 1.1
"""Multiple of the smallest error of a line up to which a law counts as near the first."""


@dataclass(frozen=True)
class Cell:
    """The flights of one entry on a course under a disturbance.

    Attributes:
        rms: (seeds,) m, true position minus the reference; NaN for a flight that crashed.
        saturated: mean share of the ticks that saturated the motors.
        effort: N/s, rms of the rate of a rotor's commanded thrust.
        tick: s, median time of a tick in machine code on the computer that flew.
    """

    entry: str
    course: str
    disturbance: str
    rms: Array
    saturated: float
    effort: float = math.nan
    tick: float = math.nan

    @property
    def failures(self) -> int:
        return int(np.isnan(self.rms).sum())

    @property
    def median(self) -> float:
        """Return the median error (m), inf where half of the flights crashed."""
        return float(np.median(np.where(np.isnan(self.rms), np.inf, self.rms)))

    def interval(self) -> tuple[float, float]:
        """Return the 95 % interval of the median by bootstrap."""
        return _interval(np.where(np.isnan(self.rms), np.inf, self.rms))

    def ratio_to(self, other: Cell) -> tuple[float, float, float]:
        """Return the median of the ratios of errors, seed by seed, and its 95 % interval.

        The seeds are those that both have flown.
        """
        both = min(len(self.rms), len(other.rms))
        own = self.rms[:both]
        ratios = np.where(np.isnan(own), np.inf, own / other.rms[:both])
        return float(np.median(ratios)), *_interval(ratios)


def _interval(values: Array) -> tuple[float, float]:
    drawn = np.random.default_rng(1).integers(len(values), size=(RESAMPLED, len(values)))
    medians = np.sort(np.median(values[drawn], axis=1))
    return float(medians[int(0.025 * RESAMPLED)]), float(medians[int(0.975 * RESAMPLED)])


@dataclass(frozen=True)
class Standing:
    """The standing of a law among the others over all lines, each a course under a disturbance.

    Attributes:
        first, near: lines in which its error is the smallest, and at most NEAR times the smallest.
        lines: number of lines in which any law flies.
        crashed, flights: number of its flights.
        over_first: geometric mean of its error over the smallest, of the lines that it flies; NaN
            if it flies none.
    """

    law: str
    first: int
    near: int
    lines: int
    crashed: int
    flights: int
    over_first: float


def lines_of(cells: Iterable[Cell]) -> list[list[Cell]]:
    """Return the cells of each course and disturbance, in their order."""
    found: dict[tuple[str, str], list[Cell]] = {}
    for one in cells:
        found.setdefault((one.course, one.disturbance), []).append(one)
    return list(found.values())


def standings(cells: Sequence[Cell]) -> list[Standing]:
    """Return the standing of each law, the one that is near the first most often before others."""
    over: dict[str, list[float]] = {one.entry: [] for one in cells}
    for line in lines_of(cells):
        best = min(one.median for one in line)
        if math.isfinite(best):
            for one in line:
                over[one.entry].append(one.median / best)
    found = []
    for law, ratios in over.items():
        own = [one for one in cells if one.entry == law]
        flown = [one for one in ratios if math.isfinite(one)]
        found.append(
            Standing(
                law=law,
                first=ratios.count(1.0),
                near=sum(one <= NEAR for one in ratios),
                lines=len(ratios),
                crashed=sum(one.failures for one in own),
                flights=sum(len(one.rms) for one in own),
                over_first=float(np.exp(np.mean(np.log(flown)))) if flown else math.nan,
            )
        )
    return sorted(found, key=lambda one: (-one.near, one.crashed))


FIGURES = {"saturated_share": "saturated", "effort_n_per_s": "effort", "processor_tick_s": "tick"}
"""Figures of a cell by their names in a file, null where none is known. What depends on the
computer begins with `processor`, as in the rows of campaigns: a repetition differs in it alone."""


def as_json(cells: Sequence[Cell]) -> str:
    """Return all flights as JSON: a crash is null."""
    rows = [
        {
            "law": one.entry,
            "course": one.course,
            "disturbance": one.disturbance,
            "position_rms_m": [_or_none(x) for x in one.rms.tolist()],
            **{key: _or_none(getattr(one, name)) for key, name in FIGURES.items()},
        }
        for one in cells
    ]
    return json.dumps(rows, indent=1)


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


def read_cells(path: Path) -> list[Cell]:
    """Read what `as_json` wrote; figures that an older file lacks are NaN. Raises StorageError."""
    with os_errors(lambda why: f"{path} cannot be read ({why})"):
        text = path.read_text(encoding="utf-8")
    try:
        return [
            Cell(
                str(one["law"]),
                str(one["course"]),
                str(one["disturbance"]),
                np.array([_or_nan(x) for x in one["position_rms_m"]]),
                **{name: _or_nan(one.get(key)) for key, name in FIGURES.items()},
            )
            for one in json.loads(text)
        ]
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise StorageError(
            f"{path.name} is no result of the arena ({type(error).__name__}: {error}); write one "
            "with `quadlab arena --out`"
        ) from None
