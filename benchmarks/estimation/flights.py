"""Smooth random flights over the paper's four beacons, with their simulated sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bearing_sim.beacons import PAPER_BEACONS
from bearing_sim.emulator import perturbed
from quadrotor.records import Array

G = 9.81
UP = np.array([0.0, 0.0, G])
RATE = 500.0  # Hz
FRAMES = 30.0  # Hz
SIGMA = np.radians(1.5)
FORCE_NOISE = 0.05  # m/s^2 per sample, as in vehicle.simulator.parameters
RATE_NOISE = np.radians(0.3)  # rad/s per sample
RATE_BIAS = 0.005  # rad/s, deviation of each component
FORCE_BIAS = 0.03  # m/s^2
SPEED = np.array([0.5, 0.5, 0.25])  # m/s rms on each axis: 0.75 together
LOW, HIGH = np.array([-1.5, -1.5, 0.3]), np.array([1.5, 1.5, 2.0])
BEACONS = PAPER_BEACONS.positions_w


@dataclass
class Frame:
    """Bearings (4, 3) at one instant, and the truth."""

    t: float
    position_w: Array
    R_wb: Array
    bearings_b: Array


@dataclass
class Flight:
    """Truth at the IMU's instants, samples with noise and bias, and frames of bearings."""

    t: Array
    position_w: Array
    velocity_w: Array
    R_wb: Array  # (n, 3, 3)
    force_b: Array  # true
    rate_b: Array
    sample: Array  # (n, 6): rate, force
    bias: Array  # (6,): rate, force
    frames: list[Frame]


class Path:
    """Three sines per axis and a swinging yaw; the attitude follows from the acceleration."""

    def __init__(self, random: np.random.Generator) -> None:
        while True:
            self.omega = 2.0 * np.pi * random.uniform(0.1, 0.25, (3, 3))
            self.phase = random.uniform(0.0, 2.0 * np.pi, (3, 3))
            speed = random.uniform(0.5, 1.0, (3, 3))
            speed *= SPEED / np.sqrt(0.5 * (speed**2).sum(axis=0))
            self.size = speed / self.omega
            self.centre = np.array([0.0, 0.0, 1.15])
            self.yaw = random.uniform(-np.pi, np.pi), random.uniform(0.3, 1.0)
            p = self.position(np.linspace(0.0, 60.0, 3000))
            if (p > LOW).all() and (p < HIGH).all():
                return

    def _waves(self, t: Array, order: int) -> Array:
        angle = np.asarray(t)[:, None, None] * self.omega + self.phase + 0.5 * np.pi * order
        waves: Array = (self.size * self.omega**order * np.sin(angle)).sum(axis=1)
        return waves

    def position(self, t: Array) -> Array:
        return self.centre + self._waves(t, 0)

    def velocity(self, t: Array) -> Array:
        return self._waves(t, 1)

    def attitude(self, t: Array) -> Array:
        """Return R_wb (n, 3, 3)."""
        z = self._waves(t, 2) + UP
        z /= np.linalg.norm(z, axis=1)[:, None]
        yaw = self.yaw[0] + self.yaw[1] * np.sin(0.7 * t)
        x = np.cross(np.stack([-np.sin(yaw), np.cos(yaw), 0.0 * yaw], 1), z)
        x /= np.linalg.norm(x, axis=1)[:, None]
        return np.stack([x, np.cross(z, x), z], 2)


def flight(seed: int, duration: float) -> Flight:
    """Return one flight of `duration` s, which depends only on the seed."""
    random = np.random.default_rng(seed)
    path = Path(random)
    t = np.arange(round(duration * RATE) + 1) / RATE
    R, h = path.attitude(t), 1e-4
    turn = np.einsum("nji,njk->nik", path.attitude(t - h), path.attitude(t + h))
    rate = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], 1) - np.stack(
        [turn[:, 1, 2], turn[:, 2, 0], turn[:, 0, 1]], 1
    )
    rate /= 4.0 * h
    force = np.einsum("nji,nj->ni", R, path._waves(t, 2) + UP)
    bias = np.concatenate([random.normal(0, RATE_BIAS, 3), random.normal(0, FORCE_BIAS, 3)])
    noise = random.normal(0, 1, (len(t), 6)) * ([RATE_NOISE] * 3 + [FORCE_NOISE] * 3)
    at = np.arange(1, int(duration * FRAMES)) / FRAMES
    frames = []
    for time, p, R_wb in zip(at, path.position(at), path.attitude(at), strict=True):
        away = (BEACONS - p) @ R_wb
        away /= np.linalg.norm(away, axis=1)[:, None]
        seen = [perturbed(tuple(d), *(SIGMA * random.normal(0, 1, 2))) for d in away.tolist()]
        frames.append(Frame(float(time), p, R_wb, np.array(seen)))
    return Flight(
        t,
        path.position(t),
        path.velocity(t),
        R,
        force,
        rate,
        np.concatenate([rate, force], 1) + bias + noise,
        bias,
        frames,
    )


def quaternion(R: Array) -> Array:
    """Return (w, x, y, z) of R (3, 3).

    It uses the trace: R is never near half a turn from level here.
    """
    from scipy.spatial.transform import Rotation

    q: Array = np.roll(Rotation.from_matrix(R).as_quat(), 1, axis=-1)
    return q
