"""Paths along which bearings tell most of where a vehicle is, planned again and again in flight.

A vehicle in R^3 x S^1 measures bearings beta_b = Rz(psi)^T g_b of landmarks b at distances d_b,
and knows its own velocity in its yaw frame. An error (dp, dpsi) at the end of a path was, at time
t, (dp - e x (p_end - p(t)) dpsi, dpsi), so that with P = I - g g^T

    d beta (in world axes) = - P / d [ I | S(b - p_end) ] (dp, dpsi),      S(r) = e x r,

and the constructibility Gramian, the information of the path on the state at its end, is

    G = 1 / sigma^2  sum over b of E_b^T (integral of P / d^2) E_b,      E_b = [ I | S(b - p_end) ].

A neighbour that sees the vehicle too adds P / d^2 with E = [ I | S(p(t) - p_end) ], in axes of the
neighbour. The path is a uniform cubic B-spline whose control points are within the radius, and
whose differences keep speed and acceleration within their limits: the spline is in their convex
hull. It ends at rest, so that the plan of before, shifted, is always one that can be flown. From
the best of it and some straight moves, gradient steps raise the smallest eigenvalue of prior
information and Gramian, each fading with `memory`.

Source: Salaris, Cognetti, Spica, Robuffo Giordano, "Online optimal perception-aware trajectory
generation", IEEE T-RO 35(6), 2019. Deviations: three dimensions and yaw instead of a unicycle; a
power mean of the eigenvalues (their Schatten norm) is taken of the information with its prior,
which fades, instead of a Riccati equation for the noise of the motion; limits by penalty and by
going back toward the former plan, instead of projections on null spaces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.rigidity import across
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

STEP = 0.5
"""s between control points, and between plans."""
SEGMENTS = 8
POINTS = SEGMENTS + 3
FREE = slice(3, POINTS - 3)
"""Control points that a plan chooses; those before are flown, those after equal its last."""
SAMPLES = 5
"""Number of samples of each segment."""
POWER = 4.0
"""Exponent of the power mean that stands for the smallest eigenvalue."""
LENGTHS = np.array([0.02, 0.06, 0.15, 0.35])
"""m, steps that are tried along the gradient."""
ROUNDS = 5
NEAREST = 0.3
"""m; a landmark nearer than this counts as at this distance: no path is drawn to run into it."""
DIRECTIONS = np.array(
    [
        (x, y, z)
        for x in (-1, 0, 1)
        for y in (-1, 0, 1)
        for z in (-1, 0, 1)
        if (x, y, z) != (0, 0, 0)
    ]
)


@dataclass(frozen=True, slots=True)
class Room:
    """The limits of a path.

    Attributes:
        centre_w: (3,) m. radius: m about it.
        lowest, highest: m, world.
        speed: m/s. acceleration: m/s^2.
    """

    centre_w: tuple[float, float, float]
    radius: float = 1.0
    lowest: float = 0.3
    highest: float = 2.0
    speed: float = 1.0
    acceleration: float = 2.0

    def __post_init__(self) -> None:
        """Raise DegenerateGeometryError for a room in which nothing can be flown."""
        if not (min(self.radius, self.speed, self.acceleration) > 0.0):
            raise DegenerateGeometryError(
                f"radius {self.radius} m, speed {self.speed} m/s and acceleration "
                f"{self.acceleration} m/s^2 must be positive"
            )
        if not self.lowest <= self.centre_w[2] <= self.highest:
            raise DegenerateGeometryError(
                f"the centre's height {self.centre_w[2]} m is not within {self.lowest} to "
                f"{self.highest} m; choose another centre"
            )

    def excess(self, points_w: Array) -> Array:
        """Return by how much control points (..., POINTS, 3) exceed each limit, in its units."""
        p = np.asarray(points_w, dtype=float)
        v = np.diff(p, axis=-2) / STEP
        a = np.diff(v, axis=-2) / STEP
        return np.concatenate(
            [
                np.linalg.norm(p - np.array(self.centre_w), axis=-1) - self.radius,
                p[..., 2] - self.highest,
                self.lowest - p[..., 2],
                np.linalg.norm(v, axis=-1) - self.speed,
                np.linalg.norm(a, axis=-1) - self.acceleration,
            ],
            axis=-1,
        )


@dataclass(frozen=True, slots=True)
class Sights:
    """Landmarks that are seen from a path.

    Attributes:
        landmarks_w: (N, 3) m: beacons, or neighbours.
        sigma: rad on each tangent axis. rate: Hz.
        mutual: whether the landmarks see the vehicle too, and tell it, as neighbours do.
        memory: s in which information fades to 1 / e, by the noise of the motion.
    """

    landmarks_w: Array
    sigma: float = math.radians(1.5)
    rate: float = 30.0
    mutual: bool = False
    memory: float = 10.0

    def __post_init__(self) -> None:
        """Raise DegenerateGeometryError for landmarks that no path makes a pose from."""
        shape = np.shape(self.landmarks_w)
        if len(shape) != 2 or shape[1] != 3 or len(self.landmarks_w) < (1 if self.mutual else 2):
            raise DegenerateGeometryError(
                f"landmarks have the shape {shape}; give (N, 3) with at least two, or one that "
                "sees the vehicle too: from one alone, the turn about it is never seen"
            )


def gramian(paths_w: Array, times: Array, sights: Sights) -> Array:
    """Return the constructibility Gramian (..., 4, 4) of paths on x, y, z (m, world) and yaw (rad)
    at their end.

    Args:
        paths_w: (..., K, 3) m. times: (K,) s, evenly spaced, of which the last is the end.
    """
    end = paths_w[..., -1, :]
    weight = np.exp((times - times[-1]) / sights.memory) * sights.rate * (times[1] - times[0])
    away = sights.landmarks_w - paths_w[..., None, :]  # (..., K, N, 3)
    distance = np.linalg.norm(away, axis=-1)
    g = away / np.maximum(distance, 1e-9)[..., None]
    share = weight[:, None] / np.maximum(distance, NEAREST) ** 2
    W = np.einsum("...kn,...knab->...nab", share, across(g))
    E = _lever(sights.landmarks_w - end[..., None, :])
    G = np.einsum("...nax,...nab,...nby->...xy", E, W, E)
    if sights.mutual:
        W = np.einsum("...kn,...knab->...kab", share, across(g))
        E = _lever(paths_w - end[..., None, :])
        G = G + np.einsum("...kax,...kab,...kby->...xy", E, W, E)
    return np.asarray(G / sights.sigma**2)


def carried(information: Array, travel_w: Array, duration: float, sights: Sights) -> Array:
    """Return the information (..., 4, 4) on the state after a path of `duration` s that ends
    `travel_w` (..., 3) m from its start, without what is measured on it.
    """
    T = np.zeros((*travel_w.shape[:-1], 4, 4))
    T[..., range(4), range(4)] = 1.0
    T[..., :3, :] = _lever(-travel_w)
    fade = math.exp(-duration / sights.memory)
    return np.asarray(fade * np.swapaxes(T, -1, -2) @ information @ T)


def smallest(information: Array) -> Array:
    """Return a smooth stand-in for the smallest eigenvalue: (sum of lambda^-q)^(-1/q)."""
    values = np.maximum(np.linalg.eigvalsh(information), 1e-9)
    least = values[..., :1]
    mean: Array = least[..., 0] * ((least / values) ** POWER).sum(axis=-1) ** (-1.0 / POWER)
    return mean


@dataclass
class LookAround:
    """A path that is planned anew each STEP seconds.

    Attributes:
        room, sights: its limits and what is seen from it.
        points_w: (POINTS, 3) m, control points; the path begins now.
    """

    room: Room
    sights: Sights
    points_w: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin at rest in the centre."""
        self.points_w = np.tile(np.array(self.room.centre_w, dtype=float), (POINTS, 1))

    def plan(self, covariance: npt.ArrayLike) -> Array:
        """Plan from now on; return the control points.

        Args:
            covariance: (4, 4) of the present estimate's x, y, z (m, world) and yaw (rad).
        """
        information = np.linalg.inv(np.asarray(covariance, dtype=float))
        former = self.points_w
        starts = np.concatenate([former[None], self._straight(former)])
        best = starts[int(np.argmax(self._value(starts, information)))]
        for _ in range(ROUNDS):
            gradient = self._gradient(best, information)
            size = float(np.linalg.norm(gradient, axis=1).max())
            if size < 1e-12:
                break
            tried = np.repeat(best[None], len(LENGTHS) + 1, axis=0)
            tried[1:, FREE] += LENGTHS[:, None, None] * gradient / size
            tried[:, FREE.stop :] = tried[:, FREE.stop - 1, None]
            values = self._value(tried, information)
            if int(np.argmax(values)) == 0:
                break
            best = tried[int(np.argmax(values))]
        best = self._flyable(former, best)
        if self._value(best, information) >= self._value(former, information):
            self.points_w = best
        return self.points_w.copy()

    def advance(self) -> None:
        """Go on by STEP seconds: the first segment of the path is flown."""
        self.points_w = np.concatenate([self.points_w[1:], self.points_w[-1:]])

    def at(self, times: npt.ArrayLike) -> tuple[Array, Array, Array]:
        """Return place (K, 3) m, velocity m/s and acceleration m/s^2, world, at times (K,) in s
        from now.
        """
        t = np.asarray(times, dtype=float)
        return tuple(basis(t, order) @ self.points_w for order in range(3))  # type: ignore[return-value]

    def _straight(self, former: Array) -> Array:
        """Return plans that go straight on from the former one's present state, as far as they can
        be flown.
        """
        reach = np.minimum(np.arange(1.0, POINTS - 4), POINTS - 5) * self.room.speed * STEP
        moves = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
        moves = np.concatenate([moves, 0.5 * moves])
        tried = np.repeat(former[None], len(moves), axis=0)
        tried[:, FREE] = former[2] + reach[: FREE.stop - 3, None] * moves[:, None, :]
        tried[:, FREE.stop :] = tried[:, FREE.stop - 1, None]
        return self._flyable(former, tried)

    def _flyable(self, former: Array, wanted: Array) -> Array:
        """Return the plans on the way from the former one to those wanted that keep to the limits:
        limits are convex, so the way back always ends at one.
        """
        shares = np.linspace(1.0, 0.0, 21)
        way = former + shares[:, None, None] * (wanted[..., None, :, :] - former)
        kept = np.asarray((self.room.excess(way) <= 1e-9).all(axis=-1))
        kept[..., -1] = True
        first = kept.argmax(axis=-1)
        return np.asarray(
            np.take_along_axis(way, first[..., None, None, None], axis=-3)[..., 0, :, :]
        )

    def _value(self, points: Array, information: Array) -> Array:
        """Return the logarithm of the smallest eigenvalue after plans (..., POINTS, 3), less a
        penalty of the limits.
        """
        path = SAMPLED @ points
        total = gramian(path, TIMES, self.sights) + carried(
            information, path[..., -1, :] - path[..., 0, :], float(TIMES[-1]), self.sights
        )
        over = np.maximum(self.room.excess(points) + 0.02, 0.0)
        return np.asarray(np.log(smallest(total)) - 20.0 * (over**2).sum(axis=-1))

    def _gradient(self, points: Array, information: Array) -> Array:
        """Return the gradient (free points, 3) of `_value`, by differences."""
        count, h = FREE.stop - FREE.start, 1e-4
        moved = np.repeat(points[None], 3 * count + 1, axis=0)
        k = np.arange(3 * count)
        moved[1 + k, FREE.start + k // 3, k % 3] += h
        moved[:, FREE.stop :] = moved[:, FREE.stop - 1, None]
        values = self._value(moved, information)
        return np.asarray((values[1:] - values[0]).reshape(count, 3) / h)


def basis(times: Array, order: int = 0) -> Array:
    """Return the weights (K, POINTS) of the control points in the path, or in its derivative."""
    x = np.clip(np.asarray(times, dtype=float) / STEP, 0.0, SEGMENTS)
    segment = np.minimum(x.astype(int), SEGMENTS - 1)
    u = x - segment
    one, zero = np.ones_like(u), np.zeros_like(u)
    powers = np.stack(
        ((one, u, u**2, u**3), (zero, one, 2.0 * u, 3.0 * u**2), (zero, zero, 2.0 * one, 6.0 * u))[
            order
        ],
        axis=1,
    )
    M = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0
    out = np.zeros((len(x), POINTS))
    rows = np.arange(len(x))[:, None]
    out[rows, segment[:, None] + np.arange(4)] = powers @ M / STEP**order
    return out


TIMES = np.arange(SEGMENTS * SAMPLES + 1) * STEP / SAMPLES
SAMPLED = basis(TIMES)


def _lever(away_w: Array) -> Array:
    """Return [I | e x r], (..., 3, 4), of vectors r (..., 3)."""
    E = np.zeros((*away_w.shape, 4))
    E[..., range(3), range(3)] = 1.0
    E[..., 0, 3] = -away_w[..., 1]
    E[..., 1, 3] = away_w[..., 0]
    return E
