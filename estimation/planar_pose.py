"""Pose of the body from one frame of bearings to at least four coplanar beacons (Sec. 6.2).

With plane coordinates (alpha, beta) of a beacon at c + alpha e1 + beta e2, its bearing is along
G (alpha, beta, 1), G = [R_bw e1, R_bw e2, R_bw (c - r)] up to scale: the four-point algorithm
without the plane's distance from the world origin, by which print divides (0 is a normal case).
The scale is that of the two projected columns, the sign that which puts the beacons along their
bearings and not against them. Gauss-Newton steps on the bearings, two as a rule, make the
estimate efficient.

Bearings may point anywhere on the sphere. The refinement is compiled; the rest are a few small
numpy calls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from estimation.bearing_refinement import invert, normalize, refine, refine_from
from quadrotor.errors import MeasurementError
from quadrotor.rotations import cross, quaternion_from_matrix

Array = npt.NDArray[np.float64]

IMPLAUSIBLE = 4.0
"""A fit whose rms residual on a tangent axis is larger than this many sigma is no pose."""
PLAUSIBLE = 2.0
"""A fit found from a prediction is taken up to this many sigma; beyond, others are tried too."""
UNOBSERVED = 1e-9
"""Ratio of pivots of the information below which some motion is not observed."""
FLATNESS = 1e-3
"""How far the beacons may leave their plane, as a share of their extent."""


@dataclass(frozen=True, slots=True)
class PlanarPose:
    """A one-frame pose.

    Attributes:
        position_w: (3,) m.
        quaternion_wb: (4,) unit, w >= 0.
        covariance: (6, 6) of position (m, world axes), then of the attitude error as a rotation
            vector (rad, world axes), as geometry_msgs/PoseWithCovariance orders them.
        residual: rms angle between measured and predicted bearings, rad. With four beacons two
            degrees of freedom are left: nearly blind to a wrong one, so gate on a prediction.
    """

    position_w: Array
    quaternion_wb: Array
    covariance: Array
    residual: float


def planar_pose(
    beacons_w: Array,
    bearings_b: Array,
    sigma: float,
    prediction: tuple[Array, Array] | None = None,
) -> PlanarPose:
    """The pose that explains the bearings best.

    Args:
        beacons_w: (N, 3) m, coplanar, not on one line, N >= 4.
        bearings_b: (N, 3) unit vectors in body axes, same order.
        sigma: rad on each of two tangent axes.
        prediction: position_w (3,) and quaternion_wb (4,) of a filter. Near the beacons' own
            plane the homography fails though the information is there: the refinement starts
            from here, and from the homography too when what it finds explains the bearings badly.

    Raises MeasurementError when the input is malformed, the geometry degenerate, or no pose fits.
    """
    beacons, bearings = _checked(beacons_w, bearings_b, sigma)
    center, axes, extent = _plane(beacons.tobytes())
    refined = []
    if prediction is not None:
        r, q = np.array(prediction[0], dtype=float), np.array(prediction[1], dtype=float)
        R, information = np.empty((3, 3)), np.empty((6, 6))
        cost = refine_from(beacons, bearings, r, q, R, information)
        refined.append((cost, r, R, information))
    if not (refined and refined[0][0] < 2.0 * len(beacons) * (PLAUSIBLE * sigma) ** 2):
        try:
            r, R = homography_pose(beacons, bearings, center, axes, extent)
            refined.append(_refine(beacons, bearings, r, R))
        except MeasurementError:
            if prediction is None:
                raise
    cost, r, R, information = min(refined, key=_cost) if len(refined) > 1 else refined[0]
    residual, expected = math.sqrt(cost / len(beacons)), math.sqrt(2.0) * sigma
    if not residual < IMPLAUSIBLE * expected:
        raise MeasurementError(
            f"no pose fits the bearings: {math.degrees(residual):.3g} deg rms remain where "
            f"{math.degrees(expected):.3g} are expected; check the beacons' identities and "
            "positions, or give a predicted pose to start from"
        )
    covariance = _covariance(information, sigma, extent)
    return PlanarPose(r, quaternion_from_matrix(R), covariance, residual)


def homography_pose(
    beacons: Array, bearings: Array, center: Array, axes: Array, extent: float
) -> tuple[Array, Array]:
    """position_w (3,) and R_wb (3, 3) by the four-point algorithm, without refinement.

    Args:
        center, axes: a point of the plane, and rows e1, e2, e3 = e1 x e2 (its normal).
        extent: m, the beacons' size, which makes the plane coordinates of order one.

    Raises MeasurementError when the bearings do not determine a homography.
    """
    plane = (beacons - center) @ axes.T / extent
    plane[:, 2] = 1.0
    # Rows of x cross (G a) = 0: two of the three are independent, keeping all treats axes alike.
    system = np.zeros((len(plane), 3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        system[:, i, k] = bearings[:, j, None] * plane
        system[:, i, j] = -bearings[:, k, None] * plane
    _, singular, vt = np.linalg.svd(system.reshape(-1, 9), full_matrices=False)
    if singular[7] < 1e-6 * singular[0]:
        raise MeasurementError(
            "bearings do not determine a pose: they are the same, in one plane, or three of four "
            "beacons stand on one line; move the vehicle or the beacons"
        )
    G = vt[8].reshape(3, 3)
    if ((plane @ G.T) * bearings).sum() < 0.0:
        G = -G
    first, second, third = G.T.copy()
    length = 0.5 * (math.sqrt(first @ first) + math.sqrt(second @ second))
    if length < 1e-9:
        raise MeasurementError(
            "bearings do not determine a pose: the beacons are too far away or seen edge-on; "
            "give a predicted pose to start from"
        )
    u, _, v = np.linalg.svd(np.column_stack([first, second, cross(first, second) / length]))
    if np.linalg.det(u @ v) < 0.0:
        u[:, 2] *= -1.0
    R_wb = np.ascontiguousarray(((u @ v) @ axes).T)
    position: Array = center - R_wb @ third * (extent / length)
    return position, R_wb


def _cost(refined: tuple[float, Array, Array, Array]) -> float:
    return refined[0]


def _refine(
    beacons: Array, bearings: Array, r: Array, R: Array
) -> tuple[float, Array, Array, Array]:
    """Cost (rad^2), r, R and information (for sigma 1) of the best pose near (r, R)."""
    position, rotation = np.array(r, dtype=float), np.array(R, dtype=float)
    information = np.empty((6, 6))
    cost = refine(beacons, bearings, position, rotation, information)
    return cost, position, rotation, information


def _covariance(information: Array, sigma: float, extent: float) -> Array:
    """sigma^2 (J^T J)^-1. Raises MeasurementError when a direction is not observed."""
    out = np.empty((6, 6))
    if not invert(information, extent, out) > UNOBSERVED:
        raise MeasurementError(
            "bearings do not determine a pose: some motion changes none of them; "
            "move the vehicle off the beacons' plane or add beacons"
        )
    return out * (sigma * sigma)


@lru_cache(maxsize=64)
def _plane(beacon_bytes: bytes) -> tuple[Array, Array, float]:
    """Centre (3,), axes (3, 3) with the normal last, and extent (m) of the beacons.

    Kept by the bytes of their positions (N, 3): beacons stand still from frame to frame.
    """
    beacons = np.frombuffer(beacon_bytes).reshape(-1, 3)
    center: Array = beacons.mean(axis=0)
    _, singular, axes = np.linalg.svd(beacons - center, full_matrices=False)
    extent = float(singular[0]) / math.sqrt(len(beacons))
    if singular[1] < 1e-3 * singular[0] or extent < 1e-6:
        raise MeasurementError(
            f"{len(beacons)} beacons stand on one line or one spot; "
            "four that span a plane are needed: move one aside"
        )
    if singular[2] > FLATNESS * singular[0]:
        off = float(np.abs((beacons - center) @ axes[2]).max())
        raise MeasurementError(
            f"beacons leave their common plane by up to {off:.3g} m; "
            f"allowed {FLATNESS * extent:.2g} m: level them or correct their positions"
        )
    axes[2] = cross(axes[0], axes[1])
    return center, axes, extent


def _checked(beacons_w: Array, bearings_b: Array, sigma: float) -> tuple[Array, Array]:
    """Both as (N, 3) floats, bearings normalised. Raises MeasurementError."""
    beacons = np.ascontiguousarray(beacons_w, dtype=float)
    bearings = np.ascontiguousarray(bearings_b, dtype=float)
    if beacons.ndim != 2 or beacons.shape[1] != 3 or beacons.shape != bearings.shape:
        raise MeasurementError(
            f"beacons of shape {beacons.shape} and bearings of shape {bearings.shape}; "
            "both must be (N, 3), one bearing a beacon"
        )
    if len(beacons) < 4:
        raise MeasurementError(
            f"{len(beacons)} bearings came; a planar pose needs at least 4: "
            "bring more beacons into view"
        )
    unit = np.empty_like(bearings)
    worst = normalize(beacons, bearings, unit)
    if not math.isfinite(worst):
        raise MeasurementError("a beacon or bearing is not finite; check the beacon detector")
    if not (math.isfinite(sigma) and sigma > 0.0):
        raise MeasurementError(f"sigma = {sigma} rad; a finite number above 0 is needed")
    if abs(worst - 1.0) > 0.01:
        raise MeasurementError(
            f"a bearing has length {worst:.4g}; unit vectors in body axes are needed (within 1 %)"
        )
    return beacons, unit
