"""What every trajectory offers."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import numpy.typing as npt

from quadrotor.records import REFERENCE, Record

Array = npt.NDArray[np.float64]


class Trajectory(Protocol):
    """A reference over time."""

    @property
    def duration(self) -> float:
        """s until the last change; inf when it has none."""
        ...

    def sample(self, t: float, reference: Record) -> None:
        """Fill the whole REFERENCE record (shape (1,)) for t (s) since the start.

        Before 0 and after `duration` the ends are held.
        """
        ...


def sample_many(trajectory: Trajectory, times: Array) -> Record:
    """References at `times` (s), shape (len(times),): for checks and plots, not for the tick."""
    out = np.zeros(len(times), REFERENCE)
    for k, t in enumerate(times):
        trajectory.sample(float(t), out[k : k + 1])
    return out
