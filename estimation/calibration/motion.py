"""Motion on a common time grid, on which two sensors of one flight can be compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from quadrotor.plain_rotations import conjugate, rotation_vectors_between
from quadrotor.records import Array

STEP = 0.01
"""Step of the grid, s."""
SMOOTH = 0.05
"""Standard deviation of the Gaussian that smooths both signals, s."""


def interpolated(at: Any, seconds: Any, values: Array) -> Array:
    """Return the columns of values (N, K) at other times, interpolated linearly."""
    return np.stack([np.interp(at, seconds, one) for one in values.T], axis=1)


def on_grid(grid: Array, seconds: Array, values: Array) -> Array:
    """Return the columns of values (N, K) on the grid, interpolated linearly and smoothed."""
    return smoothed(interpolated(grid, seconds, values))


def smoothed(values: Array, width: float = SMOOTH) -> Array:
    """Return columns (N, K) on the grid, smoothed by a Gaussian of `width` s."""
    half = round(4 * width / STEP)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) * STEP / width) ** 2)
    kernel /= kernel.sum()
    padded = np.pad(values, ((half, half), (0, 0)), mode="edge")
    return np.stack([np.convolve(one, kernel, mode="valid") for one in padded.T], axis=1)


def speed(position: Array) -> Array:
    """Return the smoothed speeds of positions on the grid, (N, 1)."""
    found = np.linalg.norm(np.gradient(position, STEP, axis=0), axis=1, keepdims=True)
    return smoothed(found, 2 * SMOOTH)


def common_grid(one: Array, other: Array) -> Array:
    return np.arange(max(one[0], other[0]), min(one[-1], other[-1]), STEP)


def joined(mine: Array, one: Array, theirs: Array, other: Array) -> tuple[Array, Array]:
    """Return both signals where they overlap."""
    inside = (mine >= theirs[0]) & (mine <= theirs[-1])
    return one[inside], interpolated(mine[inside], theirs, other)


def accelerations(position: Array) -> Array:
    """Return the second derivative of positions on the grid, (N, 3)."""
    found: Array = np.gradient(np.gradient(position, STEP, axis=0), STEP, axis=0)
    return found


def best_lag(one: Array, other: Array, most: int) -> tuple[float, float]:
    """Return the delay of `other` in fractional points of the grid, and the correlation at that
    shift.

    Args:
        one, other: (N, K) and (M, K), whose products are summed over K.
        most: largest shift searched.
    """
    a, b = one - one.mean(axis=0), other - other.mean(axis=0)
    size = len(a) + len(b)
    spectrum = np.fft.rfft(b, size, axis=0) * np.conj(np.fft.rfft(a, size, axis=0))
    found = np.fft.irfft(spectrum.sum(axis=1), size)
    shifts = np.arange(-most, most + 1)
    # Normalised by the energy of the overlap, not of the whole.
    energy_a = np.concatenate([[0.0], np.cumsum((a**2).sum(axis=1))])
    energy_b = np.concatenate([[0.0], np.cumsum((b**2).sum(axis=1))])
    low = np.clip(np.maximum(0, -shifts), 0, len(a))
    high = np.clip(np.minimum(len(a), len(b) - shifts), low, len(a))
    ea = energy_a[high] - energy_a[low]
    eb = energy_b[np.clip(high + shifts, 0, len(b))] - energy_b[np.clip(low + shifts, 0, len(b))]
    enough = high - low > 0.3 * min(len(a), len(b))
    share = np.where(enough, found[shifts % size] / np.sqrt(np.maximum(ea * eb, 1e-12)), -1.0)
    k = int(np.argmax(share))
    shift = float(shifts[k])
    if 0 < k < len(share) - 1:
        left, middle, right = share[k - 1 : k + 2]
        bend = left - 2.0 * middle + right
        shift += 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return shift, float(share[k])


@dataclass(frozen=True)
class Turn:
    """The rotation and scale that best map vectors onto others, and the share that they explain."""

    matrix: Array  # (3, 3)
    scale: float
    explained: float  # 0…1

    @property
    def angle(self) -> float:
        """Return the rotation's angle, rad."""
        return float(np.arccos(np.clip(0.5 * (np.trace(self.matrix) - 1.0), -1.0, 1.0)))


def best_turn(one: Array, other: Array) -> Turn:
    """Return the turn with other ≈ scale · matrix @ one + a constant, both (N, 3).

    The constant is fitted, too, so that a sensor's bias is not taken for a turn.
    """
    one, other = one - one.mean(axis=0), other - other.mean(axis=0)
    u, s, vt = np.linalg.svd(other.T @ one)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    matrix = (u * sign) @ vt
    energy = float((one**2).sum())
    fit = float((s * sign).sum())
    scale = fit / max(energy, 1e-12)
    explained = max(0.0, fit) ** 2 / max(energy * float((other**2).sum()), 1e-12)
    return Turn(matrix, scale, explained)


def angular_velocity(seconds: Array, quaternions: Array) -> Array:
    """Return the angular velocity (rad/s, body axes) of attitudes at N times, (N, 3)."""
    back = conjugate(quaternions)
    rates = rotation_vectors_between(back[1:], back[:-1]) / np.diff(seconds)[:, None]
    middle = 0.5 * (rates[1:] + rates[:-1])
    return np.concatenate([rates[:1], middle, rates[-1:]])
