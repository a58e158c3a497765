"""Flights of a point vehicle with yaw that finds its place by bearings, along several paths.

The vehicle flies its estimate: it follows the path by the estimate of an extended Kalman filter, as
it would on board. All flights of a call are flown together, as arrays (F, …). The bound of each is
the same recursion with the derivatives at its true path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from extensions.formations.mathematics.active_sensing import (
    FREE,
    POINTS,
    STEP,
    LookAround,
    Room,
    Sights,
)
from extensions.formations.mathematics.rigidity import E_Z, across, yaw_rotation
from quadrotor.records import Array

RATE = 30.0
SIGMA = math.radians(1.5)
START = np.array([0.3, 0.3, 0.3, math.radians(10.0)])
"""Standard deviations of place (m) and yaw (rad) before the first frame."""
YAW_NOISE = 0.003
"""rad/sqrt(s), of the yaw rate that the filter integrates."""
FOLLOW = 1.0
"""1/s, by which the vehicle goes back to its path."""
EIGHT = 0.65
"""rad/s, at which the 8 of 0.95 of the radius keeps to 1 m/s."""


class Path(StrEnum):
    """The kinds of paths."""

    HOVER = "hover"
    STRAIGHT = "straight, to and fro"
    EIGHT = "8"
    RANDOM = "random"
    LOOK_AROUND = "look_around"


@dataclass(frozen=True)
class Case:
    """Landmarks that are seen, and how well the vehicle knows its motion.

    Attributes:
        landmarks_w: (N, 3) m. mutual: whether they see the vehicle too.
        motion_noise: m/sqrt(s), of the velocity that the filter integrates.
        radius: m, about the place where a path begins.
    """

    landmarks_w: Array
    mutual: bool
    motion_noise: float
    radius: float = 1.0

    @property
    def memory(self) -> float:
        """Return the time in s after which a bearing is worth less than the motion since: the
        ratio of the two noises in balance, for a landmark at 1.5 m.
        """
        return 1.5 * SIGMA / math.sqrt(RATE) / self.motion_noise


@dataclass(frozen=True)
class Outcome:
    """The outcome of flights F over frames T.

    Attributes:
        sigma: (F, T) m, rms length of the position's error that the filter states.
        bound: (F, T) m, the Cramer-Rao bound of it along the flown path.
        error: (F, T) m, length of the error. square: (F,) normalised square of the last error, 4
            on average in a consistent filter.
    """

    sigma: Array
    bound: Array
    error: Array
    square: Array


class RandomPath(LookAround):
    """A path to a random place after another, within the same limits."""

    def __init__(self, room: Room, sights: Sights, rng: np.random.Generator) -> None:
        super().__init__(room, sights)
        self._rng = rng

    def plan(self, covariance: object) -> Array:
        """Go on to a random place within the radius."""
        away = self._rng.normal(size=3)
        away *= self.room.radius * self._rng.uniform() ** (1 / 3) / np.linalg.norm(away)
        goal = np.array(self.room.centre_w) + away
        way = goal - self.points_w[2]
        length = float(np.linalg.norm(way))
        reach = np.minimum(np.arange(1.0, POINTS - 4) * self.room.speed * STEP, length)
        wanted = self.points_w.copy()
        wanted[FREE] = self.points_w[2] + reach[: FREE.stop - 3, None] * way / max(length, 1e-9)
        wanted[FREE.stop :] = wanted[FREE.stop - 1]
        self.points_w = self._flyable(self.points_w, wanted)
        return self.points_w


def fly(path: Path, case: Case, starts_w: Array, duration: float, seed: int) -> Outcome:
    """Fly one path from each start (F, 3) for `duration` s.

    Noise of the same seed is the same on every path.
    """
    F, frames = len(starts_w), round(duration * RATE)
    noise = np.random.default_rng((seed, 0))
    p, psi = starts_w.copy(), noise.uniform(-math.pi, math.pi, F)
    error = noise.normal(size=(F, 4)) * START
    guess, yaw = p + error[:, :3], psi + error[:, 3]
    sights = Sights(case.landmarks_w, SIGMA, RATE, case.mutual, case.memory)
    steer = _Paths(path, case, guess, sights, np.random.default_rng((seed, 1)))
    P = np.tile(np.diag(START**2), (F, 1, 1))
    bound = P.copy()
    out: dict[str, list[Array]] = {"sigma": [], "bound": [], "error": []}
    dt = 1.0 / RATE
    for k in range(frames):
        velocity = steer.velocity(k, guess, P)
        velocity_y = np.einsum("fba,fb->fa", yaw_rotation(yaw), velocity)
        true_velocity = np.einsum("fab,fb->fa", yaw_rotation(psi), velocity_y)
        guess = guess + dt * velocity
        p = p + dt * true_velocity + case.motion_noise * math.sqrt(dt) * noise.normal(size=p.shape)
        psi = psi + YAW_NOISE * math.sqrt(dt) * noise.normal(size=F)
        P = _moved(P, dt * velocity, case)
        bound = _moved(bound, dt * true_velocity, case)
        J, g = _rows(p, case)
        bound = np.linalg.inv(np.linalg.inv(bound) + _information(J))
        measured = _in_own_axes(-psi, g, case)
        measured = measured + SIGMA * _tangent(noise.normal(size=g.shape), measured)
        measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
        guess, yaw, P = _corrected(guess, yaw, P, measured, case)
        out["sigma"].append(np.sqrt(np.trace(P[:, :3, :3], axis1=1, axis2=2)))
        out["bound"].append(np.sqrt(np.trace(bound[:, :3, :3], axis1=1, axis2=2)))
        out["error"].append(np.linalg.norm(guess - p, axis=1))
    last = np.concatenate([guess - p, np.arctan2(np.sin(yaw - psi), np.cos(yaw - psi))[:, None]], 1)
    square = np.einsum("fi,fij,fj->f", last, np.linalg.inv(P), last)
    sigma, bounds, errors = (np.stack(out[name], axis=1) for name in ("sigma", "bound", "error"))
    return Outcome(sigma, bounds, errors, square)


class _Paths:
    """The reference velocities of F flights."""

    def __init__(
        self, path: Path, case: Case, starts_w: Array, sights: Sights, rng: np.random.Generator
    ) -> None:
        self._path, self._case = path, case
        self._centre = starts_w.copy()
        self._centre[:, 2] = np.clip(starts_w[:, 2], 0.3, 2.0)
        self._heading = rng.uniform(-math.pi, math.pi, len(starts_w))
        rooms = [Room(tuple(one), radius=case.radius) for one in self._centre.tolist()]
        self._plans: list[LookAround] = []
        if path is Path.LOOK_AROUND:
            self._plans = [LookAround(room, sights) for room in rooms]
        elif path is Path.RANDOM:
            self._plans = [RandomPath(room, sights, rng) for room in rooms]

    def velocity(self, frame: int, guess: Array, covariances: Array) -> Array:
        """Return the velocities (F, 3) m/s, world as the vehicle believes it to be."""
        t = frame / RATE
        if self._plans:
            if frame % round(STEP * RATE) == 0:
                for plan, covariance in zip(self._plans, covariances, strict=True):
                    if frame:
                        plan.advance()
                    plan.plan(covariance)
            now = [plan.at([t % STEP])[:2] for plan in self._plans]
            place = np.stack([one[0][0] for one in now])
            rate = np.stack([one[1][0] for one in now])
        else:
            place, rate = self._fixed(t)
        return rate + FOLLOW * (place - guess)

    def _fixed(self, t: float) -> tuple[Array, Array]:
        r, w = 0.95 * self._case.radius, EIGHT / self._case.radius
        local, rate = np.zeros(3), np.zeros(3)
        if self._path is Path.EIGHT:
            local = r * np.array([math.sin(w * t), 0.5 * math.sin(2 * w * t), 0.0])
            rate = r * w * np.array([math.cos(w * t), math.cos(2 * w * t), 0.0])
        elif self._path is Path.STRAIGHT:
            local[0], rate[0] = _to_and_fro(t, r)
        R = yaw_rotation(self._heading)
        return self._centre + R @ local, R @ rate


def _to_and_fro(
    t: float, reach: float, speed: float = 1.0, acceleration: float = 2.0
) -> tuple[float, float]:
    """Return place and speed on a line from its middle to one end, to the other, and so on, with
    turns of constant acceleration.
    """
    ramp = speed / acceleration
    straight = 2.0 * reach / speed - ramp  # at full speed, of one way
    s = (t + 0.5 * straight) % (2.0 * (straight + 2.0 * ramp))
    way, s = divmod(s, straight + 2.0 * ramp)
    sign = 1.0 if way == 0.0 else -1.0
    if s < straight:
        return sign * speed * (s - 0.5 * straight), sign * speed
    s -= straight
    return (
        sign * (0.5 * speed * straight + speed * s - 0.5 * acceleration * s * s),
        sign * (speed - acceleration * s),
    )


def _moved(P: Array, travel_w: Array, case: Case) -> Array:
    A = np.tile(np.eye(4), (len(P), 1, 1))
    A[:, :3, 3] = np.cross(E_Z, travel_w)
    Q = np.diag([case.motion_noise**2] * 3 + [YAW_NOISE**2]) / RATE
    return np.asarray(A @ P @ np.swapaxes(A, 1, 2) + Q)


def _rows(p: Array, case: Case) -> tuple[Array, Array]:
    """Return the derivatives (F, M, 3, 4) of bearings in world axes, and the bearings (F, M, 3)."""
    away = case.landmarks_w - p[:, None]
    distance = np.linalg.norm(away, axis=-1)
    g = away / distance[..., None]
    move = across(g) / distance[..., None, None]
    J = np.concatenate([-move, -np.cross(E_Z, g)[..., None]], axis=-1)
    if case.mutual:
        theirs = np.concatenate([move, np.zeros((*move.shape[:-1], 1))], axis=-1)
        return np.concatenate([J, theirs], axis=1), np.concatenate([g, -g], axis=1)
    return J, g


def _information(J: Array) -> Array:
    return np.asarray(np.einsum("fmai,fmaj->fij", J, J) / SIGMA**2)


def _corrected(
    guess: Array, yaw: Array, P: Array, measured: Array, case: Case
) -> tuple[Array, Array, Array]:
    """Return place, yaw and covariance after one frame, by two Gauss-Newton steps."""
    prior = np.linalg.inv(P)
    place, turn = guess, yaw
    for _ in range(2):
        J, g = _rows(place, case)
        residual = _in_own_axes(turn, measured, case) - g
        P = np.asarray(np.linalg.inv(prior + _information(J)), dtype=float)
        back = np.concatenate([guess - place, (yaw - turn)[:, None]], axis=1)
        right = np.einsum("fmai,fma->fi", J, residual) / SIGMA**2
        step = np.einsum("fij,fj->fi", P, right + np.einsum("fij,fj->fi", prior, back))
        place, turn = place + step[:, :3], turn + step[:, 3]
    return place, turn, P


def _in_own_axes(yaw: Array, bearings: Array, case: Case) -> Array:
    """Return bearings turned by `yaw`, but those by the landmarks, whose axes are the world's."""
    count, out = len(case.landmarks_w), bearings.copy()
    out[:, :count] = np.einsum("fab,fmb->fma", yaw_rotation(yaw), bearings[:, :count])
    return out


def _tangent(noise: Array, g: Array) -> Array:
    return np.asarray(noise - g * np.sum(noise * g, axis=-1, keepdims=True))
