"""The estimates that vehicles make of where the others are, against the truth and their bound."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from extensions.formations.localiser import NOISE, TOPIC
from extensions.formations.mathematics.network_bound import at_truth
from extensions.formations.mathematics.rigidity import bearings, yaw_rotation
from extensions.formations.messages import DISTANCE_SIGMA
from extensions.formations.options import FormationOptions
from extensions.formations.shape import Shape
from extensions.formations.view import View
from flight_log.fields import POSITION
from flight_log.run import Run
from quadrotor.errors import DegenerateGeometryError
from quadrotor.records import Array

SETTLED = 90
"""Frames after which the bound of a formation that keeps its shape does not change any more."""
SHARE = 0.5
"""Of the scale, as it is known to the filter at its start."""


def judge_places(
    options: FormationOptions,
    shape: Shape,
    runs: Mapping[str, Run],
    times: Array,
    truth: tuple[Array, Array],
    left: set[int],
) -> dict[str, float]:
    """Return the error of the estimated places while the formation is held, rms of all, in cm, and
    over its bound; nothing where no vehicle has estimated any.

    The bound is that of the true mean shape, of bearings and messages of which none is lost.

    Args:
        times: (N,) s, of the hold. truth: places (N, n, 3) and yaws (N, n) at these times.
    """
    names, staying = list(runs), [k for k in range(len(runs)) if k not in left]
    squares: list[float] = []
    bounds: list[float] = []
    for own in staying:
        errors = {
            other: found
            for other in staying
            if other != own
            and len(found := _errors(runs[names[own]], names[other], own, other, times, truth))
        }
        covariance = _bound(options, shape, staying, own, truth) if errors else None
        if covariance is None:
            continue
        for other, found in errors.items():
            at = 4 * [k for k in staying if k != own].index(other)
            squares += found.tolist()
            bounds += [float(np.trace(covariance[at : at + 3, at : at + 3]))] * len(found)
    if not squares:
        return {}
    mean = math.fsum(squares) / len(squares)
    return {
        "places_rms_cm": 100.0 * math.sqrt(mean),
        "places_over_bound": math.sqrt(mean * len(bounds) / math.fsum(bounds)),
    }


def _errors(
    run: Run, name: str, own: int, other: int, times: Array, truth: tuple[Array, Array]
) -> Array:
    """Return the squared distances (m^2) of the estimates of a vehicle from where it was."""
    estimates = run.topics.get(TOPIC + name)
    if estimates is None:
        return np.zeros(0)
    table = estimates.table(POSITION, times[0], times[-1])
    at = estimates.time[(estimates.time >= times[0]) & (estimates.time <= times[-1])]
    places, yaws = truth
    away = places[:, other] - places[:, own]
    away_w = np.stack([np.interp(at, times, away[:, axis]) for axis in range(3)], axis=1)
    turn = yaw_rotation(np.interp(at, times, yaws[:, own]))
    true = np.einsum("kba,kb->ka", turn, away_w)
    return np.asarray(((table - true) ** 2).sum(axis=1))


def _bound(
    options: FormationOptions,
    shape: Shape,
    staying: list[int],
    own: int,
    truth: tuple[Array, Array],
) -> Array | None:
    """Return the least covariance of what a vehicle can estimate of the others, in order; None for
    a formation that is not rigid.
    """
    places, yaws = (one.mean(axis=0)[staying] for one in truth)
    number = {k: place for place, k in enumerate(staying)}
    every = [(number[i], number[j]) for i, j in shape.desired if i in number and j in number]
    view, sigma = View(options.bearings), math.radians(options.bearings.sigma)
    apart = [float(np.linalg.norm(places[j] - places[i])) for i, j in every]
    seen = bearings(places, yaws, every).tolist()
    edges = [
        edge
        for edge, (x, y, z), far in zip(every, seen, apart, strict=True)
        if view.weight((x, y, z), far) > 0.0
    ]
    try:
        known = at_truth(number[own], places, yaws, edges, sigma, SHARE, noise=NOISE)
    except DegenerateGeometryError:
        return None
    exact = bearings(places, yaws, edges)
    still = dict.fromkeys(range(len(staying)), (np.zeros(3), 0.0))
    for _ in range(SETTLED):
        known.predict(still, 1.0 / options.bearings.rate)
        known.bearings(edges, exact, sigma)
        if staying[1] == staying[0] + 1:  # the first one measures the distance to the next
            known.distance(0, 1, float(np.linalg.norm(places[1] - places[0])), DISTANCE_SIGMA)
    return known.covariance
