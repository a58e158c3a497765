"""An imported flight in our frames and units."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from quadrotor.records import STATE, Array, Record, Stamps


@dataclass
class Imu:
    """Samples in the body axes FLU, SI units."""

    stamps_ns: Stamps  # (N,), rising
    specific_force_b: Array  # (N, 3)
    angular_velocity_b: Array  # (N, 3)


@dataclass
class Track:
    """Poses of a body FLU in a world with z up; values that a log does not have are NaN, except
    velocities, which are then derived from the positions.
    """

    name: str  # section of the mapping
    stamps_ns: Stamps  # (N,), rising
    states: dict[str, Array]  # (N, K) by the fields of STATE, as a record of them takes more memory
    attitude_known: bool

    def record(self, rows: npt.NDArray[np.intp]) -> Record:
        """Return the states of some rows, (M,) STATE."""
        found = np.zeros(len(rows), STATE)
        for name, values in self.states.items():
            found[name] = values[rows]
        return found


@dataclass
class ImportedFlight:
    """A flight in our frames and units, on one clock."""

    vehicle: str
    source: str  # format and mapping with which it was read
    imu: Imu
    truth: Track | None = None
    estimate: Track | None = None
    sweeps: Record | None = None  # (N,) SWEEPS_SAMPLE, in order
    battery: tuple[Stamps, Array] | None = None  # V
    parameters: dict[str, float] = field(default_factory=dict)  # of a replay
    events: list[tuple[int, int, str]] = field(default_factory=list)  # stamp, level, text
    notes: list[str] = field(default_factory=list)  # what was found and done
