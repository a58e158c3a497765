"""The protocol of every trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from quadrotor.records import REFERENCE, Record

Array = npt.NDArray[np.float64]
Stretch = tuple[float, float, int]
"""Start and end (s), and the number of samples that represent it well."""

UNKNOWN_RATE = 100.0
"""Sampling rate, in Hz, for checks of a trajectory that does not define its own."""

SAMPLES_MAX = 200_000

COARSE_SAMPLES = 600
"""Number of samples of a long path whose extremes are known: as many as fit between two ticks."""

NEIGHBOURHOOD = 0.1
"""Time, in s, to either side of a known extreme that is sampled finely."""


class Trajectory(Protocol):
    """A reference over time."""

    @property
    def duration(self) -> float:
        """Return the seconds until the last change; inf when it has no end."""
        ...

    def sample(self, t: float, reference: Record) -> None:
        """Fill the whole REFERENCE record (shape (1,)) for t (s) since the start.

        Before 0 and after `duration` the ends are held.
        """
        ...


@runtime_checkable
class Surveyed(Protocol):
    """A trajectory that can be sampled as a whole in few calls: all built-in ones."""

    def sample_grid(self, t: float, step: float, references: Record) -> None:
        """Fill references[k] (shape (N,)) for t + k step (s)."""
        ...

    def stretches(self) -> tuple[Stretch, ...]:
        """Return times that contain every extreme, in order; the gaps repeat what they contain."""
        ...


def grid_sampler(trajectory: Trajectory) -> Callable[[float, float, Record], None]:
    """Return a function of t, step (s) and references (N,) that fills them at t + k step."""
    if isinstance(trajectory, Surveyed):
        return trajectory.sample_grid
    sample = trajectory.sample

    def one_by_one(t: float, step: float, references: Record) -> None:
        for k in range(len(references)):
            sample(t + k * step, references[k : k + 1])

    return one_by_one


def stretches_of(trajectory: Trajectory) -> tuple[Stretch, ...]:
    """Return where to search for the extremes of a trajectory.

    Raises ValueError when it has no end.
    """
    if isinstance(trajectory, Surveyed):
        return trajectory.stretches()
    end = trajectory.duration
    if not math.isfinite(end):
        raise ValueError("a trajectory without an end cannot be examined as a whole")
    return ((0.0, end, min(SAMPLES_MAX, max(64, round(end * UNKNOWN_RATE)))),)


def around(times: Sequence[float], duration: float) -> tuple[Stretch, ...]:
    """Return an even grid over 0..duration (s), with half of UNKNOWN_RATE near some times."""
    step = max(2.0 / UNKNOWN_RATE, duration / COARSE_SAMPLES)
    ends = {0.0, duration}
    for t in times:
        ends.update((max(0.0, t - NEIGHBOURHOOD), min(duration, t + NEIGHBOURHOOD)))
    out = []
    for a, b in pairwise(sorted(ends)):
        middle = 0.5 * (a + b)
        near = any(abs(t - middle) <= NEIGHBOURHOOD for t in times)
        fine = 2.0 / UNKNOWN_RATE if near else step
        if b - a > 1e-9:
            out.append((a, b, max(2, math.ceil((b - a) / fine))))
    return tuple(out)


def sample_many(trajectory: Trajectory, times: Array) -> Record:
    """Return references at `times` (s), shape (len(times),), for checks and plots only."""
    out = np.zeros(len(times), REFERENCE)
    for k, t in enumerate(times):
        trajectory.sample(float(t), out[k : k + 1])
    return out
