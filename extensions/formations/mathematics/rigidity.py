"""Bearing rigidity of a formation in R^3 x S^1: which shapes the measured bearings determine.

With P_k = I - g_k g_k^T, e the vertical axis, and the bearings and frames of the package, edge
k = (i, j) changes by

    beta_k' = Rz(psi_i)^T P_k (p_j' - p_i') / d_k  -  (e x beta_k) psi_i'

which fills the three rows of k of the rigidity matrix B. Whatever the edges, B does not see five
motions: translations, scaling, and the rotation of all places about the vertical with equal yaw
rates. The formation is infinitesimally rigid when it misses nothing else: rank B = 4 n - 5.

Sources: Zelazo, Franchi, Robuffo Giordano, "Rigidity theory in SE(2) for unscaled relative
position estimation using only bearing measurements", ECC 2014; Schiano, Franchi, Zelazo, Robuffo
Giordano, "A rigidity-based decentralized bearing formation controller for groups of quadrotor
UAVs", IROS 2016; Michieletto, Cenedese, Franchi, "Bearing rigidity theory in SE(3)", CDC 2016.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

NULL_MOTIONS = 5
"""Number of motions that no bearing sees."""
NEAREST = 1e-6
"""m; the direction to a nearer vehicle is undefined."""
SINGULAR = 1e-6
"""Share of the largest singular value below which a singular value counts as zero."""
E_Z = np.array([0.0, 0.0, 1.0])

Edges = npt.NDArray[np.intp]
"""(m, 2), the observer and the observed of each edge."""


def yaw_rotation(yaw: npt.ArrayLike) -> Array:
    """Return the rotations (..., 3, 3) from yaw frame to world for yaws (...) in rad."""
    angle = np.asarray(yaw, dtype=float)
    R = np.zeros((*angle.shape, 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = np.cos(angle)
    R[..., 1, 0] = np.sin(angle)
    R[..., 0, 1] = -R[..., 1, 0]
    R[..., 2, 2] = 1.0
    return R


def across(directions: Array) -> Array:
    """Return I - g g^T, (..., 3, 3), for unit vectors g (..., 3)."""
    matrices: Array = np.eye(3) - directions[..., :, None] * directions[..., None, :]
    return matrices


def checked(
    positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike
) -> tuple[Array, Array, Edges]:
    """Return places (n, 3), yaws (n,) and edges (m, 2) as arrays.

    Raises DegenerateGeometryError for shapes that do not fit, values that are not finite, an edge
    of a vehicle that is not there, one of a vehicle to itself, and coincident vehicles of an edge.
    """
    p = np.asarray(positions_w, dtype=float)
    psi = np.asarray(yaws, dtype=float)
    pairs = np.asarray(edges, dtype=np.intp).reshape(-1, 2)
    n = len(psi)
    if p.shape != (n, 3) or psi.ndim != 1:
        raise DegenerateGeometryError(
            f"places have the shape {p.shape} and yaws {psi.shape}; give (n, 3) and (n,)"
        )
    if not (np.isfinite(p).all() and np.isfinite(psi).all()):
        raise DegenerateGeometryError("a place or yaw is not finite; give numbers in m and rad")
    for i, j in pairs[((pairs < 0) | (pairs >= n)).any(axis=1)].tolist():
        raise DegenerateGeometryError(
            f"edge ({i}, {j}) names a vehicle that is not there; there are 0 to {n - 1}"
        )
    for i, j in pairs[((p[pairs[:, 1]] - p[pairs[:, 0]]) ** 2).sum(axis=1) < NEAREST**2].tolist():
        if i == j:
            raise DegenerateGeometryError(f"edge ({i}, {j}) is of a vehicle to itself; remove it")
        raise DegenerateGeometryError(
            f"vehicles {i} and {j} are at one place, so edge ({i}, {j}) has no direction; "
            "move one of them"
        )
    return p, psi, pairs


def mean_distance(positions_w: Array) -> float:
    """Return the mean distance in m over all pairs of vehicles, whether they see each other or
    not.
    """
    i, j = np.triu_indices(len(positions_w), 1)
    return float(np.linalg.norm(positions_w[i] - positions_w[j], axis=1).mean())


def bearings(positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike) -> Array:
    """Return the bearing of each edge in its observer's yaw frame, (m, 3) unit vectors.

    Args:
        positions_w: (n, 3) m. yaws: (n,) rad. edges: (m, 2), observer and observed.

    Raises DegenerateGeometryError as `checked`.
    """
    p, psi, pairs = checked(positions_w, yaws, edges)
    z = p[pairs[:, 1]] - p[pairs[:, 0]]
    g = z / np.linalg.norm(z, axis=1, keepdims=True)
    found: Array = np.einsum("kba,kb->ka", yaw_rotation(psi[pairs[:, 0]]), g)
    return found


def rigidity_matrix(positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike) -> Array:
    """Return B, (3 m, 4 n): the derivative of the bearings with respect to x, y, z (m, world) and
    yaw (rad) of vehicle 0, of vehicle 1, and so on.

    Args:
        positions_w: (n, 3) m. yaws: (n,) rad. edges: (m, 2), observer and observed.

    Raises DegenerateGeometryError as `checked`.
    """
    p, psi, pairs = checked(positions_w, yaws, edges)
    i, j = pairs.T
    z = p[j] - p[i]
    d = np.linalg.norm(z, axis=1)
    g = z / d[:, None]
    R = yaw_rotation(psi[i])
    move = np.einsum("kba,kbc->kac", R, across(g)) / d[:, None, None]
    B = np.zeros((len(pairs), 3, len(psi), 4))
    k = np.arange(len(pairs))
    B[k, :, i, :3] = -move
    B[k, :, j, :3] = move
    seen = np.einsum("kba,kb->ka", R, g)
    B[k, 0, i, 3], B[k, 1, i, 3] = seen[:, 1], -seen[:, 0]
    return B.reshape(3 * len(pairs), 4 * len(psi))


def null_motions(positions_w: npt.ArrayLike, yaws: npt.ArrayLike) -> Array:
    """Return the motions that no bearing sees, (4 n, 5), as rates of x, y, z (world) and yaw of
    each vehicle.

    The columns are translation at 1 m/s along x, y and z, scaling about the centroid at 1 / s, and
    rotation about the vertical through the centroid at 1 rad/s with equal yaw rates.
    """
    p, psi, _ = checked(positions_w, yaws, ())
    away = p - p.mean(axis=0)
    N = np.zeros((len(psi), 4, NULL_MOTIONS))
    N[:, :3, :3] = np.eye(3)
    N[:, :3, 3] = away
    N[:, :3, 4] = np.cross(E_Z, away)
    N[:, 3, 4] = 1.0
    return N.reshape(4 * len(psi), NULL_MOTIONS)


def rigidity_eigenvalue(
    positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike
) -> float:
    """Return the sixth smallest eigenvalue of B^T B, with lengths in mean distances of the
    vehicles, so that it depends on the shape alone; 0 where the formation is not rigid.

    Raises DegenerateGeometryError as `checked`.
    """
    values = _singular_values(positions_w, yaws, edges)
    value = float(values[NULL_MOTIONS]) if len(values) > NULL_MOTIONS else 0.0
    return value**2 if value > SINGULAR * float(values[-1]) else 0.0


def is_rigid(
    positions_w: npt.ArrayLike,
    yaws: npt.ArrayLike,
    edges: npt.ArrayLike,
    tolerance: float = SINGULAR,
) -> bool:
    """Return whether the bearings determine the shape: rank B = 4 n - 5.

    Args:
        tolerance: share of the largest singular value below which one counts as zero.

    Raises DegenerateGeometryError as `checked`.
    """
    values = _singular_values(positions_w, yaws, edges)
    return len(values) > NULL_MOTIONS and bool(values[NULL_MOTIONS] > tolerance * values[-1])


def missing_edges(
    positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike
) -> tuple[tuple[int, int], ...]:
    """Return edges that make the formation rigid when added; none if it is rigid.

    Greedy: each time the edge that raises the rank most, among equals the one that leaves the
    formation furthest from losing rank. No edge of the answer can be left out.

    Raises DegenerateGeometryError as `checked`, and for vehicles that no edges make rigid, as all
    in one line.
    """
    p, psi, pairs = checked(positions_w, yaws, edges)
    n = len(psi)
    present = [(i, j) for i, j in pairs.tolist()]
    others = [(i, j) for i in range(n) for j in range(n) if i != j and (i, j) not in set(present)]
    if not is_rigid(p, psi, present + others):
        raise DegenerateGeometryError(
            f"no bearings make these {n} vehicles a rigid formation, as with all in one line; "
            "move some of them"
        )
    added: list[tuple[int, int]] = []
    while not is_rigid(p, psi, present + added):
        best = max(
            (edge for edge in others if edge not in added),
            key=lambda edge: _rank_and_volume(p, psi, [*present, *added, edge]),
        )
        added.append(best)
    for edge in list(added):
        fewer = [other for other in added if other != edge]
        if is_rigid(p, psi, present + fewer):
            added = fewer
    return tuple(added)


def _singular_values(
    positions_w: npt.ArrayLike, yaws: npt.ArrayLike, edges: npt.ArrayLike
) -> Array:
    """Return the 4 n singular values of B with lengths in mean distances, ascending."""
    p, psi, pairs = checked(positions_w, yaws, edges)
    n = len(psi)
    found = np.zeros(4 * n)
    if len(pairs) and n > 1:
        values = np.linalg.svd(rigidity_matrix(p / mean_distance(p), psi, pairs), compute_uv=False)
        found[: len(values)] = values
    return np.sort(found)


def _rank_and_volume(p: Array, psi: Array, edges: Sequence[tuple[int, int]]) -> tuple[int, float]:
    values = _singular_values(p, psi, edges)
    counted = values[values > SINGULAR * values[-1]]
    return len(counted), round(math.fsum(np.log(counted).tolist()), 9)


def distance_row(p: Array, i: int, j: int) -> tuple[Array, float]:
    """Return the derivative (4 n,) of the distance (m) of vehicles i and j with respect to x, y, z
    and yaw of all, and the distance.
    """
    z = p[j] - p[i]
    distance = float(np.linalg.norm(z))
    row = np.zeros((len(p), 4))
    row[j, :3], row[i, :3] = z / distance, -z / distance
    return row.ravel(), distance
