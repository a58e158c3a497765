"""The least error that a vehicle's estimate of its network can have, as Cramer and Rao bound it.

J = sum over edges B_k^T B_k / sigma^2 is the information of a frame (B: `rigidity`), inverted on
what is determined: across the null motions. Over several frames the bound is the recursion of
`localisation` at the truth: a filter that begins there and is given exact bearings, distances and
motions stays there, and its covariance is the bound.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.localisation import MotionNoise, NetworkFilter
from extensions.formations.mathematics.rigidity import (
    E_Z,
    SINGULAR,
    checked,
    distance_row,
    null_motions,
    rigidity_matrix,
    yaw_rotation,
)
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

SCALING = 3
"""Column of the null motions that is the scaling."""


def at_truth(
    own: int,
    positions_w: npt.ArrayLike,
    yaws: npt.ArrayLike,
    edges: npt.ArrayLike,
    sigma: float,
    share: float,
    *,
    noise: MotionNoise,
) -> NetworkFilter:
    """Return the filter of vehicle `own` at the truth, whose covariance is the bound after one
    frame of bearings and of a scale that is known to a share.

    Args:
        positions_w: (n, 3) m. yaws: (n,) rad. edges: (m, 2). sigma: rad on each tangent axis.
        share: standard deviation of the logarithm of the scale. noise: of broadcast motions.

    Raises DegenerateGeometryError as `cramer_rao`.
    """
    p, psi, pairs = checked(positions_w, yaws, edges)
    places = (p - p[own]) @ yaw_rotation(psi[own])
    turns = np.arctan2(np.sin(psi - psi[own]), np.cos(psi - psi[own]))
    T = relative(p, psi, own)
    bound = T @ cramer_rao(p, psi, pairs, sigma) @ T.T  # of the shape, at a scale
    x = np.pad(np.delete(places, own, axis=0), ((0, 0), (0, 1))).ravel()
    x = x / np.linalg.norm(x)
    side = np.eye(len(x)) - np.outer(x, x)
    # Across x the scale is free to move the shape's error: no share of x in the shape's part.
    shape = side @ bound @ side
    scale = share**2 * float(np.vdot(places, places)) * np.outer(x, x)
    return NetworkFilter(own, places, turns, shape + scale, noise)


def cramer_rao(
    positions_w: npt.ArrayLike,
    yaws: npt.ArrayLike,
    edges: npt.ArrayLike,
    sigma: float,
    distance_edges: npt.ArrayLike = (),
    sigma_distance: float = 0.1,
) -> Array:
    """Return the least covariance (4 n, 4 n) of x, y, z (m, world) and yaw (rad) of each vehicle
    that an unbiased estimate from one frame can have, across the motions that are not determined.

    K frames of a formation at rest have the K-th part. Without distances the scale is not
    determined. `relative` gives the bound of what a vehicle estimates of the others.

    Args:
        sigma: rad on each tangent axis of a bearing.
        distance_edges: (q, 2), pairs whose distance is measured. sigma_distance: m.

    Raises DegenerateGeometryError as `checked`, and for a formation that is not rigid.
    """
    p, psi, pairs = checked(positions_w, yaws, edges)
    _, _, ranged = checked(p, psi, distance_edges)
    B = rigidity_matrix(p, psi, pairs)
    J = B.T @ B / sigma**2
    for i, j in ranged.tolist():
        row, _ = distance_row(p, i, j)
        J += np.outer(row, row) / sigma_distance**2
    free = null_motions(p, psi)
    if len(ranged):
        free = np.delete(free, SCALING, axis=1)
    Q = np.linalg.svd(free)[0][:, free.shape[1] :]
    values, vectors = np.linalg.eigh(Q.T @ J @ Q)
    if values[0] < SINGULAR**2 * values[-1]:
        raise DegenerateGeometryError(
            "the formation is not rigid, so its shape has no bound; add edges (missing_edges)"
        )
    half = Q @ vectors / np.sqrt(values)
    return np.asarray(half @ half.T)


def relative(positions_w: npt.ArrayLike, yaws: npt.ArrayLike, own: int) -> Array:
    """Return the derivative (4 (n - 1), 4 n) of what vehicle `own` estimates of the others, x, y, z
    in its yaw frame and yaw less its own, with respect to x, y, z (world) and yaw of all.
    """
    p, psi, _ = checked(positions_w, yaws, ())
    n = len(psi)
    R = yaw_rotation(psi[own]).T
    others = [j for j in range(n) if j != own]
    T = np.zeros((n - 1, 4, n, 4))
    for k, j in enumerate(others):
        T[k, :3, j, :3] = R
        T[k, :3, own, :3] = -R
        T[k, :3, own, 3] = -np.cross(E_Z, R @ (p[j] - p[own]))
        T[k, 3, j, 3], T[k, 3, own, 3] = 1.0, -1.0
    return T.reshape(4 * (n - 1), 4 * n)
