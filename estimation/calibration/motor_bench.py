"""The motor bench: the schedule of references, and the mean response to each step (Sec. 5.3).

References from 30 to 190 in steps of 10 are held for 5 s, with a rest of 10 s at low speed before
each so that the motor does not overheat. Force and torque of a step are means over the end of
its hold, when the rotor has settled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.errors import MeasurementError
from quadrotor.records import Array

SETTLING = 1.0
"""Seconds at the start of a hold that do not count: many time constants."""
SAMPLES_MIN = 20


@dataclass(frozen=True)
class BenchSchedule:
    """References over time.

    Attributes:
        first, last, step, rest_reference: counts.
        hold, rest: s.
    """

    first: int = 30
    last: int = 190
    step: int = 10
    hold: float = 5.0
    rest: float = 10.0
    rest_reference: int = 25

    @property
    def references(self) -> tuple[int, ...]:
        return tuple(range(self.first, self.last + 1, self.step))

    @property
    def duration(self) -> float:
        """Return the duration of all steps in s."""
        return len(self.references) * (self.hold + self.rest)

    def reference(self, time: float) -> float:
        """Return the counts at `time` (s since the start); after the end, those of the rest."""
        index, into = divmod(time, self.hold + self.rest)
        if into < self.rest or not 0 <= index < len(self.references):
            return float(self.rest_reference)
        return float(self.references[int(index)])

    def hold_of(self, index: int) -> tuple[float, float]:
        """Return start and end (s) of a step's hold."""
        end = (index + 1) * (self.hold + self.rest)
        return end - self.hold, end


@dataclass(frozen=True)
class BenchSteps:
    """One row per step, all shapes (N,)."""

    reference: Array  # counts
    force: Array  # N
    torque: Array  # N m
    force_error: Array  # N, standard error of the mean
    samples: npt.NDArray[np.int64]


def average_steps(schedule: BenchSchedule, time: Array, force: Array, torque: Array) -> BenchSteps:
    """Average a recording of (N,) samples step by step; force and torque are relative to the
    sensor's reading with the motor off.

    Raises MeasurementError when a step has too few samples: the sensor was unplugged, or the
    recording ended early.
    """
    rows = []
    for index, reference in enumerate(schedule.references):
        start, end = schedule.hold_of(index)
        inside = (time >= start + SETTLING) & (time < end)
        inside &= np.isfinite(force) & np.isfinite(torque)
        count = int(inside.sum())
        if count < SAMPLES_MIN:
            raise MeasurementError(
                f"step {reference} has {count} force samples between {start + SETTLING:.1f} and "
                f"{end:.1f} s, needed are {SAMPLES_MIN}; is the sensor plugged in? "
                "Run the bench again"
            )
        held = force[inside]
        error = held.std() / np.sqrt(count)
        rows.append((reference, held.mean(), torque[inside].mean(), error, count))
    columns = np.array(rows, dtype=np.float64).T
    references, forces, torques, errors, counts = columns
    return BenchSteps(references, forces, torques, errors, counts.astype(np.int64))


def held_steps(time: Array, reference: Array, force: Array, torque: Array) -> BenchSteps:
    """Find and average the steps of a recording of (N,) samples whose schedule is unknown.

    A step is a reference held for longer than the settling time; if it is held several times, as a
    rest is, its means are combined. Raises MeasurementError when no reference was held long enough.
    """
    changes = np.flatnonzero(np.diff(reference)) + 1
    found: dict[float, list[tuple[float, float, float, int]]] = {}
    for part in np.split(np.arange(len(time)), changes):
        settled = part[time[part] >= time[part[0]] + SETTLING]
        if len(settled) >= SAMPLES_MIN:
            held = force[settled]
            row = held.mean(), torque[settled].mean(), held.var(), len(settled)
            found.setdefault(float(reference[part[0]]), []).append(row)
    if not found:
        raise MeasurementError(
            f"no reference is held for longer than {SETTLING:g} s with {SAMPLES_MIN} samples after "
            "that; hold each for 5 s"
        )
    columns = []
    for value in sorted(found):
        forces, torques, variances, counts = np.array(found[value]).T
        total = counts.sum()
        error = np.sqrt((variances * counts).sum()) / total
        columns.append((value, forces @ counts / total, torques @ counts / total, error, total))
    references, means, mean_torques, errors, samples = np.array(columns, dtype=np.float64).T
    return BenchSteps(references, means, mean_torques, errors, samples.astype(np.int64))
