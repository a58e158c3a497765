"""Seeded flight as other systems record one, and small writers of their formats."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from quadrotor.records import Array

UP = np.array([0.0, 0.0, 9.80665])
EPOCH = 1_700_000_000.0
FRD = np.diag([1.0, -1.0, -1.0])
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass
class ForeignFlight:
    """Flight of 30 s at 100 Hz, FLU and ENU, SI units."""

    seconds: Array  # (N,), of the epoch
    position: Array  # (N, 3)
    velocity: Array  # (N, 3)
    rotation: Rotation  # N
    force: Array  # (N, 3)
    rate: Array  # (N, 3)

    @property
    def quaternion(self) -> Array:
        """Return (w, x, y, z), (N, 4)."""
        found: Array = self.rotation.as_quat()[:, [3, 0, 1, 2]]
        return found


def make_flight(seed: int = 1, seconds: float = 30.0, step: float = 0.01) -> ForeignFlight:
    """Return a smooth flight up to 2 m/s with the noise of a real IMU."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, step)
    omega = 2.0 * np.pi * random.uniform(0.15, 0.4, (3, 3))
    phase = random.uniform(0.0, 2.0 * np.pi, (3, 3))
    size = np.array([0.5, 0.5, 0.15]) / omega
    angle = t[:, None, None] * omega + phase
    position = (size * np.sin(angle)).sum(axis=1) + 1.5
    velocity = (size * omega * np.cos(angle)).sum(axis=1)
    acceleration = -(size * omega**2 * np.sin(angle)).sum(axis=1)
    z = acceleration + UP
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    yaw = 0.8 * np.sin(0.9 * t)
    y = np.cross(z, np.stack([np.cos(yaw), np.sin(yaw), 0.0 * t], axis=1))
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    rotation = Rotation.from_matrix(np.stack([np.cross(y, z), y, z], axis=2))
    turns = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / step
    rate = np.concatenate([turns[:1], 0.5 * (turns[1:] + turns[:-1]), turns[-1:]])
    force = rotation.inv().apply(acceleration + UP) + random.normal(0.0, 0.2, (len(t), 3))
    rate += random.normal(0.0, 0.01, (len(t), 3))
    return ForeignFlight(EPOCH + t, position, velocity, rotation, force, rate)


def write_csv(path: Path, columns: dict[str, Array]) -> Path:
    """Write columns with their names as the header."""
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, rows, "%.9f", ",", header=",".join(columns), comments="")
    return path


def columns_of(flight: ForeignFlight) -> dict[str, Array]:
    """Return t, gx…, ax…, px…, qw… of a flight."""
    found = {"t": flight.seconds}
    for stem, values, items in (
        ("g", flight.rate, "xyz"),
        ("a", flight.force, "xyz"),
        ("p", flight.position, "xyz"),
        ("q", flight.quaternion, "wxyz"),
    ):
        found |= {f"{stem}{item}": values[:, k] for k, item in enumerate(items)}
    return found


MAPPING = """
vehicle = "foreign"
[imu]
time = "t"
angular_velocity = ["gx", "gy", "gz"]
specific_force = ["ax", "ay", "az"]
{imu}
[truth]
time = "t"
position = ["px", "py", "pz"]
quaternion = ["qw", "qx", "qy", "qz"]
{truth}
"""


def write_mapping(path: Path, imu: str = "", truth: str = "") -> Path:
    """Write a mapping of `columns_of`, with further lines of both sections."""
    path.write_text(MAPPING.format(imu=imu, truth=truth))
    return path
