"""The readings of a vehicle in addition to its view, and the instructions to the person near it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from quadrotor.records import Array


@dataclass(frozen=True, slots=True)
class ImuReadings:
    """The IMU samples of all ticks since the last call, oldest first; there may be none."""

    time: Array  # (N,) s, vehicle clock
    specific_force_b: Array  # (N, 3) m/s^2, by the calibration in force
    angular_velocity_b: Array  # (N, 3) rad/s, without the drift
    motor_references: Array  # (N, 4) counts
    wrench: Array  # (N, 4) N and N m, commanded


@dataclass(frozen=True, slots=True)
class TrackedAttitude:
    """The newest pose of the tracker."""

    time: float  # s, vehicle clock
    quaternion_wb: Array  # (4,) w, x, y, z


@dataclass(frozen=True, slots=True)
class BenchReadings:
    """Readings of the force/torque sensor since the last call, oldest first; N may be 0."""

    time: Array  # (N,) s, vehicle clock
    force: Array  # (N,) N
    torque: Array  # (N,) N m
    speed: Array  # (N,) any unit; NaN without a tachometer


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a guided procedure, for the person next to the vehicle.

    Attributes:
        instruction: what to do now, a short sentence.
        number, count: which step of how many, from 1.
        share: of the step, 0…1.
        live: figures by name: value and unit. The page draws `X deviation` as a band about `X`;
            `pose K x`, `y`, `z` (world up in body axes, of the K-th pose held) and `next x`, `y`,
            `z` (of the next one) as points of a sphere.
    """

    instruction: str
    number: int = 0
    count: int = 0
    share: float = 0.0
    live: Mapping[str, tuple[float, str]] = field(default_factory=dict)
