"""The shape that desired bearings describe, and the bearings among them that contradict the others.

The places follow from the yaws linearly: they are the null vector, next to the translations, of
sum_k (e_i - e_j)(e_i - e_j)^T (x) (I - g_k g_k^T) with g_k = Rz(psi_i) beta_k (the bearing
Laplacian of Zhao, Zelazo, "Bearing rigidity and almost global bearing-only formation
stabilization", IEEE TAC 2016). The yaws begin at what two vehicles that see each other tell of
their relative yaw, or at random, and both are refined together by Levenberg-Marquardt steps on the
rigidity matrix, from several starts.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.rigidity import (
    NEAREST,
    Edges,
    across,
    bearings,
    is_rigid,
    mean_distance,
    null_motions,
    rigidity_matrix,
    yaw_rotation,
)
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

EXACT = 1e-9
"""rad; bearings that fit better than this are met."""
STARTS = 24
AGREED = 1e-6
"""rad; starts whose residuals differ by less have ended at one minimum."""
ENOUGH = 3
"""Starts that end at the least residual, after which no other is tried."""
STEPS = 40
DAMPING_MIN = 1e-12
"""Least damping of a step: bearings that contradict each other may leave a motion undetermined."""
STEEP = 0.2
"""Horizontal length of a bearing below which its azimuth is not used."""
AGREEMENT = math.radians(0.1)
"""Residual in rad above which bearings contradict each other."""


def realise(
    desired_bearings_y: npt.ArrayLike, edges: npt.ArrayLike, n: int
) -> tuple[Array, Array, float]:
    """Return places (n, 3), yaws (n,) and the residual: a configuration with these bearings.

    Vehicle 0 is at the origin with yaw 0, and the mean distance of the vehicles is 1: the bearings
    determine no more. The residual is the rms angle in rad between desired bearings and those of
    the configuration; of bearings that contradict each other, it is not zero. The same arguments
    have the same result.

    Args:
        desired_bearings_y: (m, 3) unit vectors. edges: (m, 2), observer and observed.

    Raises DegenerateGeometryError if a bearing is not a unit vector, an edge is twice there, or
    names a vehicle that is not there.
    """
    wanted, pairs = _checked(desired_bearings_y, edges, n)
    rng = np.random.default_rng(n)
    best: tuple[Array, Array, float] | None = None
    agreed = 0
    for start in range(STARTS):
        psi = _yaws_of_pairs(wanted, pairs, n, rng, spread=0.0 if start == 0 else 0.5)
        p = _places_at(psi, wanted, pairs, n)
        if start % 2 or _least(p) < NEAREST:  # a ring without pairs needs places at random
            p = p + rng.normal(size=(n, 3))
        found = _refined(p, psi, wanted, pairs)
        if best is None or found[2] < best[2] - AGREED:
            best, agreed = found, 0
        agreed += found[2] < best[2] + AGREED
        if best[2] < EXACT or agreed == ENOUGH:
            break
    assert best is not None
    p, psi, residual = best
    p = (p - p[0]) @ yaw_rotation(psi[0]) / mean_distance(p)
    return p, np.arctan2(np.sin(psi - psi[0]), np.cos(psi - psi[0])), residual


def contradicting_edges(
    desired_bearings_y: npt.ArrayLike, edges: npt.ArrayLike, n: int, tolerance: float = AGREEMENT
) -> tuple[tuple[int, int], ...]:
    """Return the edges without which the other desired bearings agree; none if all agree.

    Greedy: each time the edge without which the residual is least. A contradiction is found only
    as far as other bearings determine the place of the vehicle, so an edge that was turned may be
    told together with the edge that it contradicts, or instead of it.

    Args:
        tolerance: rad, rms, up to which bearings agree.

    Raises DegenerateGeometryError as `realise`.
    """
    wanted, pairs = _checked(desired_bearings_y, edges, n)
    left = list(range(len(pairs)))
    removed: list[tuple[int, int]] = []
    while len(left) > 1 and realise(wanted[left], pairs[left], n)[2] > tolerance:
        rest = {k: [one for one in left if one != k] for k in left}
        worst = min(left, key=lambda k: _residual_of_rigid(wanted[rest[k]], pairs[rest[k]], n))
        removed.append((int(pairs[worst, 0]), int(pairs[worst, 1])))
        left = rest[worst]
    return tuple(removed)


def desired_places(
    desired_bearings_y: npt.ArrayLike, edges: npt.ArrayLike, n: int
) -> tuple[Array, Array]:
    """Return the desired place of each vehicle from the centroid in its own yaw frame, (n, 3), and
    the desired yaws relative to vehicle 0, (n,) rad; the mean distance is 1.

    Raises DegenerateGeometryError as `realise`, and for bearings that contradict each other or do
    not determine a shape.
    """
    wanted, pairs = _checked(desired_bearings_y, edges, n)
    p, psi, residual = realise(wanted, pairs, n)
    if residual > AGREEMENT:
        names = ", ".join(f"({i}, {j})" for i, j in contradicting_edges(wanted, pairs, n))
        raise DegenerateGeometryError(
            f"the desired bearings contradict each other by {math.degrees(residual):.2f}° rms; "
            f"correct or remove those of {names}"
        )
    if not is_rigid(p, psi, pairs):
        raise DegenerateGeometryError(
            "the desired bearings do not determine a shape; add edges (missing_edges names some)"
        )
    return np.einsum("kba,kb->ka", yaw_rotation(psi), p - p.mean(axis=0)), psi


def _checked(bearings_y: npt.ArrayLike, edges: npt.ArrayLike, n: int) -> tuple[Array, Edges]:
    wanted = np.asarray(bearings_y, dtype=float).reshape(-1, 3)
    pairs = np.asarray(edges, dtype=np.intp).reshape(-1, 2)
    if len(wanted) != len(pairs) or not len(pairs):
        raise DegenerateGeometryError(
            f"{len(wanted)} bearings are desired of {len(pairs)} edges; give one for each edge"
        )
    seen: set[tuple[int, int]] = set()
    for k, (i, j) in enumerate(pairs.tolist()):
        if not (0 <= i < n and 0 <= j < n) or i == j:
            raise DegenerateGeometryError(
                f"edge ({i}, {j}) is of no two vehicles; there are 0 to {n - 1}"
            )
        if (i, j) in seen:
            raise DegenerateGeometryError(f"edge ({i}, {j}) is there twice; remove one of the two")
        length = float(np.linalg.norm(wanted[k]))
        if not abs(length - 1.0) < 1e-3:
            raise DegenerateGeometryError(
                f"the desired bearing of edge ({i}, {j}) has the length {length:.4g}; give a unit "
                "vector"
            )
        seen.add((i, j))
    return wanted / np.linalg.norm(wanted, axis=1, keepdims=True), pairs


def _yaws_of_pairs(
    wanted: Array, pairs: Edges, n: int, rng: np.random.Generator, spread: float
) -> Array:
    """Return yaws that make the bearings of two vehicles that see each other opposite.

    Vehicles that no such pair connects get a random yaw; all get a random part of `spread` rad.
    """
    azimuth = {
        (int(i), int(j)): math.atan2(b[1], b[0])
        for (i, j), b in zip(pairs.tolist(), wanted, strict=True)
        if math.hypot(b[0], b[1]) > STEEP
    }
    psi = rng.uniform(-math.pi, math.pi, n)
    reached: set[int] = set()
    for root in range(n):
        if root in reached:
            continue
        reached.add(root)
        front = [root]
        while front:
            i = front.pop()
            for j in range(n):
                if j not in reached and (i, j) in azimuth and (j, i) in azimuth:
                    psi[j] = psi[i] + azimuth[i, j] - azimuth[j, i] + math.pi
                    reached.add(j)
                    front.append(j)
    return psi + spread * rng.normal(size=n)


def _places_at(psi: Array, wanted: Array, pairs: Edges, n: int) -> Array:
    i, j = pairs.T
    P = across(np.einsum("kab,kb->ka", yaw_rotation(psi[i]), wanted))
    ends = np.eye(n)[j] - np.eye(n)[i]
    L = np.einsum("ka,kb,kcd->acbd", ends, ends, P)
    L += np.einsum("ab,cd->acbd", np.ones((n, n)), np.eye(3))  # the translations
    p: Array = np.linalg.eigh(L.reshape(3 * n, 3 * n))[1][:, 0].reshape(n, 3)
    ahead = np.einsum("ka,kab,kb->", p[j] - p[i], yaw_rotation(psi[i]), wanted)
    return p if ahead >= 0.0 else -p


def _refined(p: Array, psi: Array, wanted: Array, pairs: Edges) -> tuple[Array, Array, float]:
    """Return places, yaws and residual after Levenberg-Marquardt steps."""
    if _least(p) < NEAREST:
        return p, psi, math.inf
    n = len(psi)
    p = p / mean_distance(p)
    error = bearings(p, psi, pairs) - wanted
    damping = 1e-3
    for _ in range(STEPS):
        B = rigidity_matrix(p, psi, pairs)
        N = null_motions(p, psi)
        step = np.linalg.solve(
            B.T @ B + N @ N.T + damping * np.eye(4 * n), -B.T @ error.ravel()
        ).reshape(n, 4)
        p_new, psi_new = p + step[:, :3], psi + step[:, 3]
        if _least(p_new) < NEAREST:
            damping *= 10.0
            continue
        error_new = bearings(p_new, psi_new, pairs) - wanted
        gained = float(np.vdot(error, error) - np.vdot(error_new, error_new))
        if gained > 0.0:
            p, psi, error = p_new / mean_distance(p_new), psi_new, error_new
            damping = max(0.1 * damping, DAMPING_MIN)
        else:
            damping *= 10.0
        if np.abs(step).max() < 1e-12 or damping > 1e8 or 0.0 < gained < 1e-16:
            break
    angles = 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(error, axis=1), 0.0, 1.0))
    return p, psi, float(np.sqrt(np.mean(angles**2)))


def _residual_of_rigid(wanted: Array, pairs: Edges, n: int) -> float:
    """Return the residual; a bearing without which the shape is lost is not the wrong one."""
    p, psi, residual = realise(wanted, pairs, n)
    return residual if is_rigid(p, psi, pairs) else residual + math.pi


def _least(p: Array) -> float:
    """Return the least distance between two vehicles, m."""
    i, j = np.triu_indices(len(p), 1)
    return float(np.linalg.norm(p[i] - p[j], axis=1).min()) if len(p) > 1 else math.inf
