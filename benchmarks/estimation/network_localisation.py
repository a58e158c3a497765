"""The error of a vehicle's filter of its formation against the Cramer-Rao bound of the network.

Random formations see each other at 30 Hz and 1.5 deg; each broadcasts its motion. The bound is the
same recursion with the derivatives at the truth: a filter that begins at the truth and is given
exact bearings, distances and motions stays there, and its covariance is the bound.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from extensions.formations.mathematics.localisation import MotionNoise, NetworkFilter
from extensions.formations.mathematics.network_bound import at_truth
from extensions.formations.mathematics.rigidity import (
    Edges,
    across,
    bearings,
    mean_distance,
    rigidity_eigenvalue,
)
from quadrotor.records import Array

RATE = 30.0
SIGMA = math.radians(1.5)
SIGMA_DISTANCE = 0.1
SHARE = 0.3
"""Standard deviation of the logarithm of the scale at the start."""
LEAST = 0.1
"""Rigidity eigenvalue of the formations."""
STILL = MotionNoise(1e-9, 1e-9, 1e-9, 1e-9)


@dataclass(frozen=True)
class Case:
    """Formations of n vehicles over some frames, at rest or moving, with or without distances."""

    n: int
    frames: int
    moving: bool
    ranged: bool


def run(size: Size = Size.FULL) -> Report:
    """Run all cases."""
    count = size.of(200, 50, 4)
    report = Report(
        "network_localisation",
        "Localisation of a formation from bearings alone",
        [
            f"{count} random formations a row, rigidity eigenvalue above {LEAST:g}; all edges at "
            f"{RATE:g} Hz and 1.5° for 2 s",
            "moving at 0.3 m/s and 0.3 rad/s, broadcast with 0.02 m/√s and 0.005 rad/√s; distance "
            "of two vehicles at 10 Hz with 0.1 m; scale known to 30 % at the start",
            "error of the others' places and yaws over the bound, rms, without the scale where "
            "no distance tells it; 95 % bootstrap interval",
        ],
    )
    for n in size.some((3, 5)):
        for moving in (False, True):
            for ranged in (False, True):
                ratios = squares(Case(n, 60, moving, ranged), count)
                low, high = interval(ratios)
                ratio = math.sqrt(float(ratios.mean()))
                what = f"{n} {'moving' if moving else 'at rest'}{', distances' * ranged}"
                report.rows.append(
                    Row(what, {"error / bound": ratio, "interval": f"{low:.3f}–{high:.3f}"})
                )
                report.targets.append(Target(f"{what}: error / bound", ratio, 1.1))
    return report


def interval(ratios: Array) -> tuple[float, float]:
    """Return the 95 % bootstrap interval of the root of the mean."""
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, len(ratios), (2000, len(ratios)))
    low, high = np.percentile(np.sqrt(ratios[chosen].mean(axis=1)), [2.5, 97.5])
    return float(low), float(high)


def squares(case: Case, count: int) -> Array:
    """Return of each formation the square of the error at the end over that of the bound."""
    found: list[float] = []
    seed = 0
    while len(found) < count:
        rng = np.random.default_rng((case.n, seed))
        seed += 1
        p = rng.uniform(-1.5, 1.5, (case.n, 3))
        yaws = rng.uniform(-math.pi, math.pi, case.n)
        edges = np.array([(i, j) for i in range(case.n) for j in range(case.n) if i != j])
        if rigidity_eigenvalue(p, yaws, edges) > LEAST:
            found.append(_square(case, p, yaws, edges, rng))
    return np.array(found)


def _square(case: Case, p: Array, yaws: Array, edges: Edges, rng: np.random.Generator) -> float:
    n, dt = case.n, 1.0 / RATE
    noise = MotionNoise() if case.moving else STILL
    guess = mean_distance(p) * rng.lognormal(0.0, SHARE)
    first = _noisy(rng, bearings(p, yaws, edges))
    told = replace(noise, tells_scale=not case.ranged)
    flown = NetworkFilter.from_bearings(0, n, first, edges, SIGMA, guess, SHARE, told)
    truth = at_truth(0, p, yaws, edges, SIGMA, SHARE, noise=noise)
    for k in range(1, case.frames):
        if case.moving:
            v, w = _motion(n, k * dt)
            heard_v = v + rng.normal(size=v.shape) * noise.velocity / math.sqrt(dt)
            heard_w = w + rng.normal(size=n) * noise.yaw_rate / math.sqrt(dt)
            flown.predict({i: (heard_v[i], float(heard_w[i])) for i in range(n)}, dt)
            truth.predict({i: (v[i], float(w[i])) for i in range(n)}, dt)
        exact = bearings(truth.positions_y, truth.yaws, edges)
        flown.bearings(edges, _noisy(rng, exact), SIGMA)
        truth.bearings(edges, exact, SIGMA)
        if case.ranged and k % 3 == 0:
            distance = float(np.linalg.norm(truth.positions_y[1]))
            flown.distance(0, 1, distance + SIGMA_DISTANCE * rng.normal(), SIGMA_DISTANCE)
            truth.distance(0, 1, distance, SIGMA_DISTANCE)
    x = np.pad(truth.positions_y[1:], ((0, 0), (0, 1))).ravel()
    places, covariance = flown.positions_y, truth.covariance
    if not case.ranged:  # the scale is left out
        places = places * np.vdot(truth.positions_y, places) / np.vdot(places, places)
        side = np.eye(len(x)) - np.outer(x, x) / np.vdot(x, x)
        covariance = side @ covariance @ side
    turn = flown.yaws - truth.yaws
    error = np.column_stack([places - truth.positions_y, np.arctan2(np.sin(turn), np.cos(turn))])
    return float(np.vdot(error, error) / np.trace(covariance))


def _motion(n: int, t: float) -> tuple[Array, Array]:
    i = np.arange(n)
    v = [0.3 * np.sin(0.5 * t + i), 0.3 * np.cos(0.4 * t + 2 * i), 0.1 * np.sin(0.3 * t + 0 * i)]
    return np.column_stack(v), 0.3 * np.sin(0.2 * t + i)


def _noisy(rng: np.random.Generator, exact: Array) -> Array:
    turned = exact + np.einsum("kab,kb->ka", across(exact), SIGMA * rng.normal(size=exact.shape))
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))
