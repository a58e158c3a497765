"""A flight of another make: as its file has it, and as ours."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from quadrotor.records import Record

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]


@dataclass
class Imu:
    """Samples in the body's axes FLU, SI units."""

    stamps_ns: Stamps  # (N,), rising
    specific_force_b: Array  # (N, 3)
    angular_velocity_b: Array  # (N, 3)


@dataclass
class Track:
    """Poses of a body FLU in a world with z up; what a log does not have is NaN.

    Attributes:
        velocity_known: whether the log has it; else it is derived of the positions.
    """

    name: str  # section of the mapping
    stamps_ns: Stamps  # (N,), rising
    states: Record  # (N,) STATE
    attitude_known: bool
    velocity_known: bool


@dataclass
class ImportedFlight:
    """A flight in our frames and units, by one clock."""

    vehicle: str
    source: str  # format and mapping it was read with
    imu: Imu
    truth: Track | None = None
    estimate: Track | None = None
    sweeps: Record | None = None  # (N,) SWEEPS_SAMPLE, in order
    battery: tuple[Stamps, Array] | None = None  # V
    events: list[tuple[int, int, str]] = field(default_factory=list)  # stamp, level, text
    notes: list[str] = field(default_factory=list)  # what was found and done
