"""Many formations of point vehicles with yaw at once, flown by the law, as arrays (S, …).

`Flight.rates` is the law of `law.formation_velocity` for all vehicles and flights together; a test
holds the two to each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from extensions.formations.mathematics.law import STEEP, Gains
from extensions.formations.mathematics.realisation import desired_places
from extensions.formations.mathematics.rigidity import (
    E_Z,
    Edges,
    bearings,
    rigidity_eigenvalue,
    yaw_rotation,
)
from extensions.formations.mathematics.steering import steering_pace
from quadrotor.records import Array

Mask = npt.NDArray[np.bool_]

DT = 1.0 / 30.0
SIGMA = math.radians(1.5)
HELD = 0.5
"""s for which a neighbour's message is used."""


def ring(n: int) -> tuple[Edges, Array, Array]:
    """Return edges, places and yaws of vehicles on a circle of 1.5 m, alternately 0.3 m up and
    down, that look at its centre.
    """
    angle = 2.0 * math.pi * np.arange(n) / n
    height = 0.3 * (-1.0) ** np.arange(n)
    p = np.column_stack([1.5 * np.cos(angle), 1.5 * np.sin(angle), height])
    return complete(n), p, angle + math.pi


def complete(n: int) -> Edges:
    """Return the edges of vehicles that all see each other."""
    return np.array([(i, j) for i in range(n) for j in range(n) if i != j])


def scattered(rng: np.random.Generator, n: int, least: float = 0.7) -> Array:
    """Return places in a room of 3 x 3 x 1.5 m that are at least `least` m apart."""
    while True:
        p = rng.uniform(-1.5, 1.5, (n, 3)) * (1.0, 1.0, 0.5)
        i, j = np.triu_indices(n, 1)
        if np.linalg.norm(p[i] - p[j], axis=1).min() > least:
            return p


@dataclass
class Network:
    """Noise and messages.

    Attributes:
        sigma: rad on each tangent axis. loss: share of messages. delay: s.
        half_angle: rad, of the view about each vehicle's yaw axis x.
        compass: whether relative yaws are known without the bearings.
    """

    sigma: float = SIGMA
    loss: float = 0.0
    delay: float = 0.0
    half_angle: float = math.pi
    compass: bool = False


@dataclass
class Flight:
    """Flights S of n vehicles.

    Attributes:
        wanted: (S, m, 3) desired bearings. places_w: (S, n, 3) m. yaws: (S, n) rad.
    """

    edges: Edges
    wanted: Array
    places_w: Array
    yaws: Array
    rng: np.random.Generator
    network: Network = field(default_factory=Network)
    gains: Gains = field(default_factory=lambda: Gains(sigma=SIGMA))

    def __post_init__(self) -> None:
        S, m, n = len(self.wanted), len(self.edges), self.yaws.shape[1]
        index = {(int(i), int(j)): k for k, (i, j) in enumerate(self.edges)}
        self.back = np.array([index[int(j), int(i)] for i, j in self.edges])
        self.held, self.age = np.zeros((S, m, 3)), np.full((S, m), np.inf)
        self.sent: list[tuple[Array, Mask]] = []
        self.leaving = np.eye(n)[self.edges[:, 0]].T
        self.arriving = np.eye(n)[self.edges[:, 1]].T
        self.lost = np.zeros((S, m), dtype=bool)

    def true_bearings(self) -> Array:
        """Return the bearings (S, m, 3) in the observers' yaw frames."""
        i, j = self.edges.T
        z = self.places_w[:, j] - self.places_w[:, i]
        g = z / np.linalg.norm(z, axis=-1, keepdims=True)
        return np.asarray(np.einsum("skba,skb->ska", yaw_rotation(self.yaws[:, i]), g))

    def error(self) -> Array:
        """Return the rms angle (S,) in degrees between true and desired bearings."""
        half = 0.5 * np.linalg.norm(self.true_bearings() - self.wanted, axis=-1)
        return np.asarray(np.degrees(np.sqrt(np.mean((2.0 * np.arcsin(half)) ** 2, axis=1))))

    def seen(self) -> Mask:
        """Return which edges (S, m) are in view."""
        ahead = self.true_bearings()[..., 0] >= math.cos(self.network.half_angle)
        return np.asarray(ahead & ~self.lost)

    def step(self, feed: tuple[Array, Array] | None = None) -> None:
        """Fly one frame.

        Args:
            feed: velocities (S, n, 3) m/s in yaw frames and yaw rates (S, n) rad/s to be added.
        """
        true = self.true_bearings()
        noise = self.rng.normal(size=true.shape) * self.network.sigma
        measured = true + noise - true * np.sum(noise * true, axis=-1, keepdims=True)
        measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
        seen = self.seen()
        self.sent.append((measured, seen))
        self.age += DT
        if len(self.sent) > round(self.network.delay / DT):
            old, there = self.sent.pop(0)
            heard = there & (self.rng.uniform(size=there.shape) >= self.network.loss)
            self.held[heard], self.age[heard] = old[heard], self.network.delay
        velocity, rate = self.rates(measured, seen, self.held, self.age <= HELD)
        if feed is not None:
            velocity, rate = velocity + feed[0], rate + feed[1]
        middle = yaw_rotation(self.yaws + 0.5 * DT * rate)
        self.places_w = self.places_w + DT * np.einsum("snab,snb->sna", middle, velocity)
        self.yaws = self.yaws + DT * rate

    def rates(
        self, measured: Array, seen: Mask, heard: Array, is_heard: Mask
    ) -> tuple[Array, Array]:
        """Return velocities (S, n, 3) in yaw frames and yaw rates (S, n).

        Args:
            measured, seen: bearings (S, m, 3) at their observers, and where they are.
            heard, is_heard: those at the observed, as the observers told them.
        """
        gains, n = self.gains, self.yaws.shape[1]
        out = self._pull(measured) * seen[..., None]
        # At the far end i of edge (j, i): the yaw of i less that of j.
        mine, theirs = measured[:, self.back], heard
        relative = _azimuth(theirs) + math.pi - _azimuth(mine)
        flat = np.minimum(_flat(mine), _flat(theirs)) >= STEEP
        flat &= seen[:, self.back] & (not self.network.compass)
        truth = self.yaws[:, self.edges[:, 1]] - self.yaws[:, self.edges[:, 0]]
        relative = np.where(flat, relative, truth)  # carried on by the gyroscopes
        into = np.einsum("skab,skb->ska", yaw_rotation(-relative), self._pull(heard))
        into *= is_heard[..., None]
        pull = np.einsum("nk,ska->sna", self.arriving, into)
        pull -= np.einsum("nk,ska->sna", self.leaving, out)
        velocity = gains.bearing * n / len(self.edges) * pull
        speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
        velocity *= np.minimum(1.0, gains.speed_limit / np.maximum(speed, 1e-12))
        wanted, back = self.wanted, self.wanted[:, self.back]
        usable = is_heard & (np.minimum(_flat(wanted), _flat(back)) >= STEEP)
        turn = np.sin(_azimuth(wanted) + math.pi - _azimuth(back) - relative) * usable
        number = np.einsum("nk,sk->sn", self.arriving, usable.astype(float))
        pairs = np.einsum("nk,sk->sn", self.arriving, turn) / np.maximum(number, 1.0)
        cross = wanted[..., 0] * measured[..., 1] - wanted[..., 1] * measured[..., 0]
        visible = np.einsum("nk,sk->sn", self.leaving, seen.astype(float))
        single = np.einsum("nk,sk->sn", self.leaving, cross * seen) / np.maximum(visible, 1.0)
        rate = gains.yaw * np.where(number > 0, pairs, single)
        return velocity, np.clip(rate, -gains.yaw_rate_limit, gains.yaw_rate_limit)

    def _pull(self, beta: Array) -> Array:
        along = np.sum(beta * self.wanted, axis=-1, keepdims=True)
        return np.asarray((1.0 - 2.0 * self.gains.sigma**2) * self.wanted - along * beta)


def random_flights(
    n: int, seeds: range, network: Network | None = None, *, near: bool = False
) -> Flight:
    """Return a flight of each seed: a random desired shape with random yaws, and a random start."""
    edges = complete(n)
    wanted, places, yaws = [], [], []
    for seed in seeds:
        rng = np.random.default_rng((n, seed))
        shape, heading = scattered(rng, n), rng.uniform(-math.pi, math.pi, n)
        wanted.append(bearings(shape, heading, edges))
        places.append(shape if near else scattered(rng, n))
        yaws.append(heading if near else rng.uniform(-math.pi, math.pi, n))
    return Flight(
        edges,
        np.array(wanted),
        np.array(places),
        np.array(yaws),
        np.random.default_rng((n, seeds.start)),
        network or Network(),
    )


class Steering:
    """The part of a commanded motion that each vehicle adds, in the axes of vehicle 0.

    It follows from the desired shape, with the distance of vehicles 0 and 1 as its scale, measured
    with 5 cm.
    """

    def __init__(self, flight: Flight, bound: float = 0.0) -> None:
        n = flight.yaws.shape[1]
        known = [desired_places(one, flight.edges, n) for one in flight.wanted]
        self._flight, self._bound = flight, bound
        self._places = np.array([places for places, _ in known])
        turned = [yaw_rotation(yaws[1]) @ places[1] - places[0] for places, yaws in known]
        self._apart = np.linalg.norm(turned, axis=1)

    def feed(
        self, velocity: tuple[float, float, float], yaw_rate: float, scale: float
    ) -> tuple[Array, Array]:
        """Return velocities (S, n, 3) and yaw rates (S, n)."""
        flight = self._flight
        apart = np.linalg.norm(flight.places_w[:, 1] - flight.places_w[:, 0], axis=1)
        apart = apart + 0.05 * flight.rng.normal(size=len(apart))
        place = self._places * (apart / self._apart)[:, None, None]
        back = yaw_rotation(flight.yaws[:, :1] - flight.yaws)
        feed = np.einsum("snab,b->sna", back, np.array(velocity))
        feed = feed + yaw_rate * np.cross(E_Z, place) + scale * place
        pace = self.pace()
        rates = np.broadcast_to(yaw_rate * pace[:, None], flight.yaws.shape)
        return pace[:, None, None] * feed, rates

    def pace(self) -> Array:
        """Return the share of the command (S,) that is flown."""
        return np.array([steering_pace(one, self._bound) for one in self.eigenvalues()])

    def eigenvalues(self) -> list[float]:
        """Return the rigidity eigenvalue of each flight with the edges that are seen."""
        flight = self._flight
        if not self._bound:
            return [1.0] * len(flight.yaws)
        return [
            rigidity_eigenvalue(p, yaws, flight.edges[seen])
            for p, yaws, seen in zip(flight.places_w, flight.yaws, flight.seen(), strict=True)
        ]


def _azimuth(vectors: Array) -> Array:
    return np.asarray(np.arctan2(vectors[..., 1], vectors[..., 0]))


def _flat(vectors: Array) -> Array:
    return np.asarray(np.hypot(vectors[..., 0], vectors[..., 1]))
