"""The decentralised law that flies a formation by its bearings.

Places. For desired bearings beta*_ij, of which bearings g_ij and g*_ij = Rz(psi_i) beta*_ij are
in world axes, each edge k = (i, j) moves both its ends, so that they turn toward its bearing:

    a_k = (I - g_k g_k^T) g*_k,
    p_i' = (n / m) K ( - sum over edges (i, j) of w_k a_k  +  sum over edges (j, i) of w_k a_k )

with n vehicles, m edges, K in m/s and weights 0 <= w_k <= 1 that both ends know. It needs no
distance and no place: vehicle i measures the first sum, and learns of the second what neighbours
broadcast, their bearing of it. All terms are turned to its own yaw frame by relative yaws.

Yaws. Two vehicles with desired bearings of each other have a desired relative yaw, the one that
makes these bearings opposite; so

    psi_i' = C (1 / number) sum over such j of sin((psi_j - psi_i) - (psi_j - psi_i)*)

and where vehicle i has no such neighbour in contact, the gradient of the bearing error,
C (1 / number) e . (beta*_ij x beta_ij), turned so that it falls.

What holds (all weights constant or varying, also those that are zero for a while):

1. Centroid and scale sum |p_i - c|^2 do not change: a_k moves the two ends oppositely, and
   sum_i (p_i - c) . p_i' = (n / m) K sum_k w_k z_k . a_k = 0 since a_k is across z_k.
2. With the yaws at the desired relative ones, let p* be the desired shape with the same centroid,
   scale and heading, z*_k = d*_k g*_k. Then for V = |p - p*|^2 / 2
       V' = - (n / m) K sum_k w_k d*_k |a_k|^2 <= 0,
   since sum p_i . p_i' = 0: the distance to p* never grows, whichever edges vanish or return. With
   weights that do not vanish for ever on a rigid graph it converges to p* from all starts but the
   point reflection of p*, which is unstable (Zhao and Zelazo 2016, theorem 2, here with w_k).
3. The yaws do not depend on the places. On a connected graph of pairs they converge from all starts
   with errors within a half circle (from almost all on trees and complete graphs); on rings of
   five or more a twisted state is stable too.
4. By 1 places stay on a sphere, so with 3 the whole is a cascade whose limit is 2: local
   convergence follows, and almost global where 3 is. With one-sided edges in place of pairs only
   the local convergence of the gradient holds.

Bearing error. The law is not the gradient of V_b = 1/2 sum |beta_k - beta*_k|^2 in places, which
has w_k = 1 / d_k (Schiano et al. 2016 then replace the unknown distances by constants, after which
V_b need not fall; the distance to p* does).

Noise. With measured g^ = g + noise of sigma on each tangent axis, E[g^ g^T] is
(1 - 3 sigma^2) g g^T + sigma^2 I, so that a_k has a mean along g_k and the formation grows by about
4 sigma^2 K / d each second. With (1 - 2 sigma^2) I in place of I the mean is across g_k again:
`Gains.sigma`. Where relative yaws are those of the same frame's bearings (`relative_yaw`), their
errors are correlated with a_k, and about - sigma^2 K / d remains; with compasses, or yaws that are
filtered, nothing.

Deviations from the publications: Schiano et al. 2016 command yaw rates by the gradient, here by
relative yaws, which has a far larger region of convergence and makes the cascade; distances are not
estimated for the law; weights do not raise the rigidity eigenvalue along its gradient as in Schiano
and Robuffo Giordano, "Bearing rigidity maintenance for formations of quadrotor UAVs", ICRA 2017:
they fall to zero before an edge vanishes, and the commanded motion slows down while the eigenvalue
is low (`steering`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

STEEP = 0.2
"""Horizontal length of a bearing below which its azimuth is not used."""


@dataclass(frozen=True, slots=True)
class Gains:
    """Gains and limits of the law.

    Attributes:
        bearing: K, m/s. Shape errors fall at up to 2 K n / ((n - 1) distance) in 1/s, so that a
            delay of T s needs 2 K T / distance well below 1.
        yaw: C, rad/s.
        speed_limit: m/s. yaw_rate_limit: rad/s.
        sigma: rad, noise of a bearing on each tangent axis, whose inflation of the formation is
            taken out.
    """

    bearing: float = 1.0
    yaw: float = 1.0
    speed_limit: float = 1.0
    yaw_rate_limit: float = 1.0
    sigma: float = 0.0

    def __post_init__(self) -> None:
        """Raise ValueError for gains that do not fly."""
        for name in ("bearing", "yaw", "speed_limit", "yaw_rate_limit"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(
                    f"the gain {name} is {getattr(self, name)}; give a positive number"
                )
        if not 0.0 <= self.sigma < 0.5:
            raise ValueError(f"sigma is {self.sigma} rad; give 0 to 0.5")


Vector = tuple[float, float, float]
Seen = Mapping[int, npt.ArrayLike]
"""By neighbour: its bearing (3,) in the own yaw frame."""
SeenBy = Mapping[int, tuple[npt.ArrayLike, float]]
"""By neighbour: its bearing (3,) of this vehicle in its yaw frame, and the yaw of this vehicle less
that of the neighbour, rad."""
Desired = Mapping[tuple[int, int], npt.ArrayLike]
"""By edge (observer, observed): the desired bearing (3,) in the observer's yaw frame."""


def relative_yaw(bearing_y: npt.ArrayLike, bearing_of_own: npt.ArrayLike) -> float | None:
    """Return the yaw of this vehicle less that of a neighbour in rad, from the bearings that the
    two measure of each other; None for bearings too steep to tell.

    Seen from above the two bearings are opposite: psi_i + azimuth of beta_ij = psi_j + azimuth of
    beta_ji + pi.

    Args:
        bearing_y: (3,) of the neighbour. bearing_of_own: (3,) by the neighbour.
    """
    mine, theirs = _floats(bearing_y), _floats(bearing_of_own)
    if min(math.hypot(mine[0], mine[1]), math.hypot(theirs[0], theirs[1])) < STEEP:
        return None
    return _wrapped(math.atan2(theirs[1], theirs[0]) + math.pi - math.atan2(mine[1], mine[0]))


def formation_velocity(
    own: int,
    seen: Seen,
    seen_by: SeenBy,
    desired: Desired,
    gains: Gains,
    weights: Mapping[tuple[int, int], float] | None = None,
    *,
    yaws: npt.ArrayLike | None = None,
) -> tuple[Array, float]:
    """Return the velocity (3,) m/s of vehicle `own` in its own yaw frame, and its yaw rate, rad/s.

    Edges that are not desired are ignored, and desired ones that are not seen add nothing.

    Args:
        weights: 0 to 1 by edge, the same at both of its ends; 1 for others.
        yaws: rad, of all vehicles in the desired shape; with them a vehicle turns by all that see
            it, also where its own bearings are not in use.

    Raises DegenerateGeometryError for a bearing that is not a unit vector.
    """
    weights = weights or {}
    share = len({one for edge in desired for one in edge}) / max(1, len(desired))
    x = y = z = 0.0
    for j, bearing in seen.items():
        if (own, j) in desired:
            edge = own, j
            weight = weights.get(edge, 1.0)
            px, py, pz = _pull(_unit(bearing, edge), _unit(desired[edge], edge), gains.sigma)
            x, y, z = x - weight * px, y - weight * py, z - weight * pz
    for j, (bearing, yaw) in seen_by.items():
        if (j, own) in desired:
            edge = j, own
            weight = weights.get(edge, 1.0)
            px, py, pz = _pull(_unit(bearing, edge), _unit(desired[edge], edge), gains.sigma)
            c, s = math.cos(yaw), math.sin(yaw)
            x, y, z = (
                x + weight * (c * px + s * py),
                y + weight * (c * py - s * px),
                z + weight * pz,
            )
    speed = gains.bearing * share * math.hypot(x, y, z)
    scale = gains.bearing * share * min(1.0, gains.speed_limit / max(speed, 1e-12))
    rate = gains.yaw * _turn(own, seen, seen_by, desired, yaws)
    rate = max(-gains.yaw_rate_limit, min(gains.yaw_rate_limit, rate))
    return scale * np.array([x, y, z]), rate


def _pull(beta: Vector, wanted: Vector, sigma: float) -> Vector:
    """Return (I - g g^T) g*, in the observer's yaw frame, without the mean of its noise."""
    along = beta[0] * wanted[0] + beta[1] * wanted[1] + beta[2] * wanted[2]
    rest = 1.0 - 2.0 * sigma * sigma
    return (
        rest * wanted[0] - along * beta[0],
        rest * wanted[1] - along * beta[1],
        rest * wanted[2] - along * beta[2],
    )


def _turn(
    own: int, seen: Seen, seen_by: SeenBy, desired: Desired, yaws: npt.ArrayLike | None
) -> float:
    """Return the yaw rate for a gain of 1."""
    turns = []
    if yaws is not None:
        of = _floats(yaws)
        turns = [math.sin(of[own] - of[j] - yaw) for j, (_, yaw) in seen_by.items()]
        seen_by = {}
    for j, (_, yaw) in seen_by.items():
        if (own, j) in desired and (j, own) in desired:
            wanted = relative_yaw(desired[own, j], desired[j, own])
            if wanted is not None:
                turns.append(math.sin(wanted - yaw))
    if not turns:
        for j, bearing in seen.items():
            if (own, j) in desired:
                wanted_y, beta = _floats(desired[own, j]), _floats(bearing)
                turns.append(wanted_y[0] * beta[1] - wanted_y[1] * beta[0])
    return math.fsum(turns) / len(turns) if turns else 0.0


def _floats(vector: npt.ArrayLike) -> list[float]:
    values: list[float] = np.asarray(vector, dtype=float).tolist()
    return values


def _unit(bearing: npt.ArrayLike, edge: tuple[int, int]) -> Vector:
    values = _floats(bearing)
    if isinstance(values, list) and len(values) == 3:
        x, y, z = values
        length = math.hypot(x, y, z)
        if abs(length - 1.0) < 1e-3:
            return x / length, y / length, z / length
    raise DegenerateGeometryError(
        f"the bearing of edge {edge} is no unit vector of 3: {values}; leave it out"
    )


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)
