"""The accuracy with which one frame of bearings can determine a pose: its Cramer-Rao bound.

With d the unit vector from the vehicle to a beacon and rho their distance, the bearing's two
tangent components change by -(I - d d^T) / rho with position and by d cross phi with rotation, each
measured with sigma. Summed over the beacons seen, the information on (position, rotation) is

    1 / sigma^2  [ A    B ]     A = sum (I - d d^T) / rho^2     B = [s] cross, s = sum d / rho
                 [ B^T  D ]     D = sum (I - d d^T)

and the bounds are the traces of the two blocks of its inverse, through the Schur complements
A - B D^-1 B^T and D - B^T A^-1 B. Neither depends on the attitude, except through visibility.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bearing_sim.beacon_set import LEAST, Beacons
from quadrotor.records import Array

if TYPE_CHECKING:
    from bearing_sim.bearing_parameters import BearingParameters

Symmetric = tuple[Array, Array, Array, Array, Array, Array]
"""xx, yy, zz, xy, xz, yz of symmetric matrices, one for each point."""

UNSEEN = 1e-12
"""Share of the information below which the rest is rounding error, as in the pose solver."""
NEAREST = 1e-9
"""m; the direction to a nearer beacon is undefined."""
LARGEST_MAP = 250_000
"""Largest number of points; a finer spacing is increased to stay below it."""


@dataclass(frozen=True)
class FieldOfView:
    """The field of view of a sensor, which determines the visible beacons.

    Attributes:
        axis_b: unit vector, the sensor's axis in body axes.
        half_angle: rad about it; pi for all directions.
        range_min, range_max: m.
        lost: ids of dark beacons; None for all.
    """

    axis_b: tuple[float, float, float] = (0.0, 0.0, -1.0)
    half_angle: float = math.pi
    range_min: float = 0.0
    range_max: float = math.inf
    lost: frozenset[int] | None = frozenset()

    @classmethod
    def of(cls, parameters: BearingParameters) -> FieldOfView:
        """Return the field of view of the emulated sensor, without its random effects (spells,
        drop-out, swaps).
        """
        from bearing_sim.bearing_parameters import parse_lost

        p = parameters
        roll, pitch, yaw = (math.radians(a) for a in (p.mount_roll, p.mount_pitch, p.mount_yaw))
        away = math.cos(roll) * math.sin(pitch)
        axis_b = (
            -(math.cos(yaw) * away + math.sin(yaw) * math.sin(roll)),
            -(math.sin(yaw) * away - math.cos(yaw) * math.sin(roll)),
            -math.cos(roll) * math.cos(pitch),
        )
        half_angle = math.radians(0.5 * p.field_of_view)
        return cls(axis_b, half_angle, p.range_min, p.range_max, parse_lost(p.lost))


@dataclass(frozen=True, eq=False)
class BoundMap:
    """The position bound over a horizontal slice.

    Attributes:
        x, y: (nx,), (ny,) m, world, ascending and evenly spaced: the centres of cells that fill
            the slice.
        height: m.
        position: (ny, nx) m, rms length; NaN where the pose is not determined.
    """

    x: Array
    y: Array
    height: float
    position: Array


def frame_bound(
    position_w: npt.ArrayLike,
    rotation_wb: npt.ArrayLike,
    beacon_positions_w: npt.ArrayLike,
    sigma: float,
) -> tuple[float, float]:
    """Return the Cramer-Rao bound of one frame: rms lengths of the errors of position (m) and
    attitude (rad).

    NaN for both when fewer than 4 beacons are given, or when they do not determine the pose.

    Args:
        position_w: (3,) m. rotation_wb: (3, 3), body to world; rotates the bearings, which changes
            neither length. beacon_positions_w: (N, 3) m, of the visible beacons.
        sigma: rad on each of two tangent axes.
    """
    beacons = np.asarray(beacon_positions_w, dtype=float).reshape(-1, 3)
    point = np.asarray(position_w, dtype=float).reshape(3, 1)
    R = np.asarray(rotation_wb, dtype=float)
    ray_b = R.T @ (beacons.T - point)
    position, attitude = _variances(ray_b[:, None, :], np.ones((1, len(beacons)), bool))
    return sigma * math.sqrt(position[0]), sigma * math.sqrt(attitude[0])


def bound_map(
    beacons: Beacons,
    sigma: float,
    x_limits: tuple[float, float],
    y_limits: tuple[float, float],
    height: float,
    *,
    sight: FieldOfView | None = None,
    spacing: float = 0.1,
) -> BoundMap:
    """Return the position bound of one frame at level attitude, yaw 0, over a horizontal slice.

    Args:
        sigma: rad on each of two tangent axes. x_limits, y_limits, height: m, world.
        sight: field of view of the sensor; None for an unlimited one.
        spacing: m, the largest side of a cell; increased where the slice is too large for it.
    """
    sight = sight or FieldOfView()
    width, depth = x_limits[1] - x_limits[0], y_limits[1] - y_limits[0]
    spacing = max(spacing, math.sqrt(width * depth / LARGEST_MAP))
    x, y = _middles(*x_limits, spacing), _middles(*y_limits, spacing)
    bright = [k for k, id in enumerate(beacons.ids.tolist()) if id not in (sight.lost or ())]
    places = beacons.positions_w[[] if sight.lost is None else bright]
    rays = np.empty((3, len(y), len(x), len(places)))
    rays[0] = places[:, 0] - x[:, None]
    rays[1] = (places[:, 1] - y[:, None])[:, None]
    rays[2] = places[:, 2] - height
    ray = rays.reshape(3, len(y) * len(x), len(places))
    distance = np.sqrt((ray**2).sum(axis=0))
    seen = (sight.range_min <= distance) & (distance <= sight.range_max)
    if sight.half_angle < math.pi:
        along = np.tensordot(np.array(sight.axis_b), ray, 1)
        seen &= along >= math.cos(sight.half_angle) * distance
    position, _ = _variances(ray, seen)
    return BoundMap(x, y, height, sigma * np.sqrt(position).reshape(len(y), len(x)))


def _middles(low: float, high: float, spacing: float) -> Array:
    count = max(1, math.ceil((high - low) / spacing - 1e-9))
    middles: Array = low + (high - low) * (np.arange(count, dtype=np.float64) + 0.5) / count
    return middles


def _variances(ray: Array, seen: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the traces of the bounds for sigma 1, (K,) m^2 and rad^2; NaN where the pose is not
    determined.

    Args:
        ray: (3, K, N) m, from K points to N beacons. seen: (K, N).
    """
    rho = np.sqrt((ray**2).sum(axis=0))
    seen = seen & (rho > NEAREST)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        s = np.where(seen, 1.0 / rho, 0.0)
        d = ray * s
        h = d * s
        count = seen.sum(axis=1).astype(float)
        D = _less_outer(count, d)
        A = _less_outer((s * s).sum(axis=1), h)
        lever = h.sum(axis=2)
        position, seen_position = _trace_of_inverse(_schur(A, lever, D), A)
        attitude, seen_attitude = _trace_of_inverse(_schur(D, lever, A), D)
    known = (count >= LEAST) & seen_position & seen_attitude
    return np.where(known, position, np.nan), np.where(known, attitude, np.nan)


def _less_outer(whole: Array, v: Array) -> Symmetric:
    """Return whole I - sum v v^T over the last axis of v (3, K, N)."""
    x, y, z = v
    xx, yy, zz, xy, xz, yz = (
        np.einsum("kn,kn->k", a, b) for a, b in ((x, x), (y, y), (z, z), (x, y), (x, z), (y, z))
    )
    return whole - xx, whole - yy, whole - zz, -xy, -xz, -yz


def _schur(A: Symmetric, s: Array, D: Symmetric) -> Symmetric:
    """Return a - [s] D^-1 [s]^T, with [s] the matrix of the cross product; s is (3, K)."""
    det, (xx, yy, zz, xy, xz, yz) = _adjugate(D)
    x, y, z = s
    return (
        A[0] - (z * z * yy - 2.0 * y * z * yz + y * y * zz) / det,
        A[1] - (z * z * xx - 2.0 * x * z * xz + x * x * zz) / det,
        A[2] - (y * y * xx - 2.0 * x * y * xy + x * x * yy) / det,
        A[3] - (z * (x * yz - z * xy) + y * (z * xz - x * zz)) / det,
        A[4] - (z * (y * xy - x * yy) + y * (x * yz - y * xz)) / det,
        A[5] - (z * (x * xy - y * xx) - x * (x * yz - y * xz)) / det,
    )


def _adjugate(m: Symmetric) -> tuple[Array, Symmetric]:
    """Return the determinant, and the inverse multiplied by it."""
    xx, yy, zz, xy, xz, yz = m
    adjugate = (
        yy * zz - yz * yz,
        xx * zz - xz * xz,
        xx * yy - xy * xy,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xy * xz - xx * yz,
    )
    return xx * adjugate[0] + xy * adjugate[3] + xz * adjugate[4], adjugate


def _trace_of_inverse(m: Symmetric, whole: Symmetric) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Return the trace, and whether there is an inverse; `whole` is m before its subtraction."""
    det, (xx, yy, zz, *_) = _adjugate(m)
    trace = m[0] + m[1] + m[2]
    least = np.minimum(np.minimum(m[0], m[1]), m[2])
    sound = (least > UNSEEN * (whole[0] + whole[1] + whole[2])) & (det > UNSEEN * trace**3)
    return (xx + yy + zz) / det, sound
