"""The places of the others from bearings alone: a filter that each vehicle runs for itself.

The state is the network as vehicle `own` sees it: place p_j in own's yaw frame, and yaw psi_j less
own's, of each other vehicle. No world frame is needed. It is carried by what vehicles broadcast of
their motion, and corrected by own's bearings, those that neighbours broadcast, and distances if
there are any:

    p_j' = Rz(psi_j) v_j - v_own - w_own e x p_j,       psi_j' = w_j - w_own,
    beta_ij = Rz(psi_i)^T (p_j - p_i) / d_ij.

Bearings do not tell the scale; only distances or metric velocities do. A filter that is linearised
anew at each estimate forgets this: its uncertain direction stays at the old estimate's p, which is
not a scaling of the new one, and so bearings seem to tell the scale. Therefore the error of the
scale is multiplicative: a correction s p + q, with q across p, leads to p+ = exp(s) (p + q), and
the covariance is turned by exp(s) (I - p p^T / |p|^2) + p+ p^T / |p|^2, which maps scaling to
scaling (the reset of an error-state filter, here of the group of scalings; cf. Barrau, Bonnabel,
"The invariant extended Kalman filter as a stable observer", IEEE TAC 2017).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.realisation import realise
from extensions.formations.mathematics.rigidity import (
    SINGULAR,
    checked,
    distance_row,
    rigidity_matrix,
    yaw_rotation,
)
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

GATE = 18.4
"""Squared normalised innovation of a bearing's two axes above which it is not used: 0.01 % of good
ones."""
S_Z = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
"""Cross product with the vertical."""


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Densities of the noise of broadcast motions.

    Attributes:
        velocity: m/s/sqrt(Hz). yaw_rate: rad/s/sqrt(Hz).
        unknown_velocity, unknown_yaw_rate: of a vehicle of which nothing was heard, taken as still.
        tells_scale: whether the scale is taken from motions. Their noise passes for motion, so that
            they tell less than the filter believes: with distances, better not.
    """

    velocity: float = 0.02
    yaw_rate: float = 0.005
    unknown_velocity: float = 0.5
    unknown_yaw_rate: float = 0.3
    tells_scale: bool = True


@dataclass
class NetworkFilter:
    """The filter of vehicle `own`.

    Attributes:
        own: its index.
        positions_y: (n, 3) m, in its yaw frame; its own is zero.
        yaws: (n,) rad, less its own; its own is zero.
        covariance: (4 (n - 1), 4 (n - 1)), of x, y, z and yaw of the others in order.
        noise: of broadcast motions.
        refused: number of bearings that did not fit, by edge.
    """

    own: int
    positions_y: Array
    yaws: Array
    covariance: Array
    noise: MotionNoise = field(default_factory=MotionNoise)
    refused: dict[tuple[int, int], int] = field(default_factory=dict)

    @classmethod
    def from_bearings(
        cls,
        own: int,
        n: int,
        bearings_y: npt.ArrayLike,
        edges: npt.ArrayLike,
        sigma: float,
        distance: float = 2.0,
        distance_share: float = 0.5,
        noise: MotionNoise | None = None,
    ) -> NetworkFilter:
        """Return a filter that begins at one frame of bearings.

        Args:
            bearings_y: (m, 3) unit vectors. edges: (m, 2), observer and observed. sigma: rad on
                each tangent axis.
            distance: m, a guess of the mean distance of all vehicles. distance_share: its standard
                deviation as a share.

        Raises DegenerateGeometryError for a frame that does not determine the shape.
        """
        p, psi, _ = realise(bearings_y, edges, n)
        p *= distance
        R = yaw_rotation(psi[own])
        p, psi = (p - p[own]) @ R, np.arctan2(np.sin(psi - psi[own]), np.cos(psi - psi[own]))
        start = cls(own, p, psi, np.zeros((4 * (n - 1), 4 * (n - 1))), noise or MotionNoise())
        B = rigidity_matrix(p, psi, edges)[:, start._columns]
        values = np.linalg.svd(B * start._unit, compute_uv=False)
        least = B.shape[1] - 2  # the scale is not determined
        if len(values) <= least or values[least] < SINGULAR * values[0]:
            raise DegenerateGeometryError(
                "the bearings of this frame do not determine the shape; wait for one with more "
                "edges"
            )
        scaling = start._places().ravel()
        scaling = scaling / np.vdot(scaling, scaling)
        information = B.T @ B / sigma**2 + np.outer(scaling, scaling) / distance_share**2
        start.covariance = np.asarray(np.linalg.inv(information), dtype=float)
        return start

    def predict(self, motions: Mapping[int, tuple[npt.ArrayLike, float]], dt: float) -> None:
        """Carry the estimate on by `dt` s.

        Args:
            motions: by vehicle, also own: velocity (3,) m/s in its yaw frame, and yaw rate, rad/s.
                A vehicle that is not there is taken as still, with the noise of the unknown.
        """
        n = len(self.yaws)
        v = np.array([motions[j][0] if j in motions else (0.0, 0.0, 0.0) for j in range(n)], float)
        w = np.array([motions[j][1] if j in motions else 0.0 for j in range(n)], float)
        known = np.array([j in motions for j in range(n)])
        q_v = dt * np.where(known, self.noise.velocity, self.noise.unknown_velocity) ** 2
        q_w = dt * np.where(known, self.noise.yaw_rate, self.noise.unknown_yaw_rate) ** 2
        back = yaw_rotation(-w[self.own] * dt)
        moved_w = np.einsum("kab,kb->ka", yaw_rotation(self.yaws + 0.5 * w * dt), v) * dt
        before = self._places().ravel()
        own_w = yaw_rotation(0.5 * w[self.own] * dt) @ v[self.own] * dt
        self.positions_y = (self.positions_y + moved_w - own_w) @ back.T
        self.positions_y[self.own] = 0.0
        self.yaws = np.arctan2(np.sin(turned := self.yaws + (w - w[self.own]) * dt), np.cos(turned))
        others = self._others
        F = np.zeros((n - 1, 4, n - 1, 4))
        common = np.zeros((n - 1, 4, 4))
        single = np.zeros((n - 1, 4, n - 1, 4))
        for k, j in enumerate(others):
            F[k, :3, k, :3] = back
            F[k, :3, k, 3] = back @ S_Z @ moved_w[j]
            F[k, 3, k, 3] = 1.0
            common[k, :3, :3] = -back
            common[k, :3, 3] = -S_Z @ self.positions_y[j]
            common[k, 3, 3] = -1.0
            single[k, range(3), k, range(3)] = q_v[j]
            single[k, 3, k, 3] = q_w[j]
        size = 4 * (n - 1)
        G, A = common.reshape(size, 4), F.reshape(size, size)
        if not self.noise.tells_scale:  # a scaling stays a scaling
            A = A + np.outer(self._places().ravel() - A @ before, before) / np.vdot(before, before)
        q_own = np.array([q_v[self.own]] * 3 + [q_w[self.own]])
        P = A @ self.covariance @ A.T + (G * q_own) @ G.T + single.reshape(size, size)
        self.covariance = 0.5 * (P + P.T)

    def bearings(self, edges: npt.ArrayLike, bearings_y: npt.ArrayLike, sigma: float) -> int:
        """Correct the estimate by bearings of one moment; return how many were used.

        The others do not fit the estimate (an identity swapped, a sensor turned), and are counted
        in `refused`.

        Args:
            edges: (m, 2), observer and observed. bearings_y: (m, 3) unit vectors in the
                observers' yaw frames. sigma: rad on each tangent axis.

        Raises DegenerateGeometryError for an edge of a vehicle that is not there.
        """
        _, _, pairs = checked(self.positions_y, self.yaws, edges)
        measured = np.asarray(bearings_y, dtype=float).reshape(-1, 3)
        z = self.positions_y[pairs[:, 1]] - self.positions_y[pairs[:, 0]]
        z = np.einsum("kba,kb->ka", yaw_rotation(self.yaws[pairs[:, 0]]), z)
        expected = z / np.linalg.norm(z, axis=1, keepdims=True)
        T = _tangents(expected)
        B = rigidity_matrix(self.positions_y, self.yaws, pairs)[:, self._columns]
        H = np.einsum("kta,kax->ktx", T, B.reshape(len(pairs), 3, -1))
        r = np.einsum("kta,ka->kt", T, measured)
        behind = np.einsum("ka,ka->k", measured, expected) < 0.0
        innovation = np.einsum("ktx,xy,ksy->kts", H, self.covariance, H) + sigma**2 * np.eye(2)
        squares = np.einsum("kt,kt->k", r, np.linalg.solve(innovation, r[..., None])[..., 0])
        fits = (squares <= GATE) & ~behind
        for i, j in pairs[~fits].tolist():
            self.refused[i, j] = self.refused.get((i, j), 0) + 1
        if fits.any():
            self._correct(H[fits].reshape(-1, H.shape[-1]), r[fits].ravel(), sigma)
        return int(fits.sum())

    def distance(self, i: int, j: int, distance: float, sigma: float) -> None:
        """Correct the estimate by a distance in m with standard deviation `sigma`.

        It is compared by its logarithm, in which it is linear in the error of the scale.

        Raises DegenerateGeometryError for a distance that is not positive.
        """
        if not distance > 0.0:
            raise DegenerateGeometryError(
                f"the distance of vehicles {i} and {j} is {distance} m; leave it out"
            )
        row, expected = distance_row(self.positions_y, i, j)
        residual = np.array([math.log(distance / expected)])
        self._correct(row[None, self._columns] / expected, residual, sigma / distance)

    @property
    def estimate(self) -> tuple[Array, Array, Array]:
        """Return places (n, 3) m in own's yaw frame, yaws (n,) rad less own's, and the covariance
        of the others' x, y, z and yaw.
        """
        return self.positions_y.copy(), self.yaws.copy(), self.covariance.copy()

    def _correct(self, H: Array, residual: Array, sigma: float) -> None:
        information = np.linalg.inv(self.covariance) + H.T @ H / sigma**2
        P = np.linalg.inv(information)
        step = (P @ H.T @ residual / sigma**2).reshape(-1, 4)
        others, before = self._others, self._places().ravel()
        scaling = before / np.vdot(before, before)
        share = float(scaling @ step.ravel())
        place = self.positions_y[others]
        self.positions_y[others] = math.exp(share) * (place + step[:, :3] - share * place)
        self.yaws[others] += step[:, 3]
        stretch = np.tile([math.exp(share)] * 3 + [1.0], len(others))
        T = np.diag(stretch) + np.outer(self._places().ravel() - stretch * before, scaling)
        P = T @ P @ T.T
        self.covariance = 0.5 * (P + P.T)

    def _places(self) -> Array:
        """Return the others' x, y, z and 0: the scaling in coordinates of the state, (n - 1, 4)."""
        places = np.zeros((len(self.yaws) - 1, 4))
        places[:, :3] = self.positions_y[self._others]
        return places

    @property
    def _others(self) -> list[int]:
        return [j for j in range(len(self.yaws)) if j != self.own]

    @property
    def _columns(self) -> list[int]:
        return [4 * j + c for j in self._others for c in range(4)]

    @property
    def _unit(self) -> Array:
        """Return the unit in which each column of the state is as large as a yaw: m, or rad."""
        length = float(np.linalg.norm(self.positions_y[self._others], axis=1).mean())
        return np.tile([length, length, length, 1.0], len(self.yaws) - 1)


def _tangents(directions: Array) -> Array:
    """Return two unit vectors across each direction, (m, 2, 3)."""
    axis = np.eye(3)[np.abs(directions).argmin(axis=1)]
    t = np.cross(directions, axis)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    return np.stack([t, np.cross(directions, t)], axis=1)
