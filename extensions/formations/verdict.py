"""The verdict on the flight of a formation, from the truth in all logs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from console.evaluation.result import Result
from console.evaluation.verdict import judged
from extensions.formations.mathematics.rigidity import bearings
from extensions.formations.options import FormationOptions
from extensions.formations.places import judge_places
from extensions.formations.separation import SEPARATION
from extensions.formations.shape import Shape
from flight_log.fields import ATTITUDE, POSITION
from flight_log.run import Run, read_run
from quadrotor.records import Array

ROOM = (-4.0, -4.0, 0.2), (4.0, 4.0, 3.0)
"""m, smallest and largest corner of the flight volume."""
STEADY, STEERED = 1.0, 2.5
"""deg, largest rms of the true bearings about the desired ones."""
CUT = "cut_s"
"""Figure of a vehicle whose link is cut on purpose: when."""
RATE = 20.0
"""Hz, at which the truth is looked at."""


class Windows(NamedTuple):
    """Times, s: the law begins, has converged, has held, and ends."""

    begun: float
    converged: float
    held: float
    end: float


def judge(
    options: FormationOptions,
    shape: Shape,
    windows: Windows,
    logs: Mapping[str, Path],
    results: Mapping[str, Result],
) -> Result:
    """Return the figures of all vehicles with their limits.

    A vehicle that fails or whose link is cut on purpose is left out of the bearings, and so is one
    that failed by itself.
    """
    names = list(logs)
    ended = [name for name, one in results.items() if one.verdict != "passed"]
    left = left_out(options, results)
    times = np.arange(windows.begun, windows.end, 1.0 / RATE)
    runs = {name: read_run(log) for name, log in logs.items()}
    places, yaws = true_places(runs, times)
    errors = bearing_errors(shape, places, yaws, left)
    steady = (times >= windows.converged) & (times < windows.held)
    metrics = {"steady_bearing_rms_deg": _rms(errors[steady])}
    limits = {"steady_bearing_rms_deg": STEADY}
    if windows.end > windows.held:
        metrics["steered_bearing_rms_deg"] = _rms(errors[times >= windows.held])
        limits["steered_bearing_rms_deg"] = STEERED
    truth = places[steady], yaws[steady]
    metrics |= judge_places(options, shape, runs, times[steady], truth, left)
    metrics["start_bearing_rms_deg"] = _rms(errors[:1])
    if (converged := _converged(times, errors)) is not None:
        metrics["converged_s"] = converged - windows.begun
    i, j = np.triu_indices(len(names), 1)
    apart = np.linalg.norm(places[:, i] - places[:, j], axis=2)
    metrics["separation_lack_m"] = max(0.0, SEPARATION - float(apart.min()))
    limits["separation_lack_m"] = 0.0
    late = {options.joins - 1} if options.joins else set()  # on the ground until it joins
    from_start, there = (np.delete(places, sorted(one), axis=1) for one in (left | late, left))
    joined = there[times >= windows.converged]
    metrics["outside_volume_m"] = max(outside(from_start), outside(joined))
    limits["outside_volume_m"] = 0.0
    _add_own_figures(results, left, metrics, limits)
    result = judged(metrics, limits)
    if ended and result.verdict == "passed":
        result.verdict = "failed"
    result.reason = "; ".join(
        f"{name}: {results[name].reason or 'beyond its limits'}" for name in ended
    )
    return result


def left_out(options: FormationOptions, results: Mapping[str, Result]) -> set[int]:
    """Return the vehicles that are no part of the formation that is judged, from 0."""
    left = {k for k, one in enumerate(results.values()) if one.verdict != "passed"}
    left |= {k for k, one in enumerate(results.values()) if CUT in one.metrics}
    return left | ({options.fails - 1} if options.fails else set())


def _add_own_figures(
    results: Mapping[str, Result],
    left: set[int],
    metrics: dict[str, float],
    limits: dict[str, float],
) -> None:
    """Add the worst of what vehicles know of themselves, and of what is judged of any flight."""
    staying = [one for k, one in enumerate(results.values()) if k not in left]
    metrics["eigenvalue_min"] = min(
        (one.metrics.get("eigenvalue_min", 0.0) for one in staying), default=0.0
    )
    metrics["effort_m_s"] = max(
        (one.metrics.get("effort_m_s", 0.0) for one in staying), default=0.0
    )
    for figure in ("emergencies", "impact_m_s", "tilt_max_deg"):
        of_all = [one.metrics[figure] for one in results.values() if figure in one.metrics]
        if of_all:
            metrics[figure] = max(of_all)
            limits[figure] = max(one.limits.get(figure, 0.0) for one in results.values())


def outside(places: Array) -> float:
    """Return by how many metres the farthest of places (…, 3) is outside the flight volume."""
    low, high = np.array(ROOM)
    return float(np.maximum(low - places, places - high).max(initial=0.0))


def true_places(runs: Mapping[str, Run], times: Array) -> tuple[Array, Array]:
    """Return places (N, n, 3) and yaws (N, n) at these times (N,)."""
    places, yaws = [], []
    for run in runs.values():
        truth = run.topics["truth"]
        at = truth.time
        places.append(
            np.stack([np.interp(times, at, truth.values(name)) for name in POSITION], axis=1)
        )
        w, x, y, z = (truth.values(name) for name in ATTITUDE)
        yaw = np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
        yaws.append(np.interp(times, at, yaw))
    return np.stack(places, axis=1), np.stack(yaws, axis=1)


def bearing_errors(shape: Shape, places: Array, yaws: Array, left: set[int]) -> Array:
    """Return the angles (N, K), deg, of the true bearings to the desired ones, of those that are
    judged.
    """
    edges = [edge for edge in shape.desired if not left.intersection(edge)]
    wanted = np.array([shape.desired[edge] for edge in edges])

    def errors(place: Array, yaw: Array) -> Array:
        true = bearings(place, yaw, edges)
        across = np.linalg.norm(np.cross(true, wanted), axis=1)
        angles: Array = np.degrees(np.arctan2(across, (true * wanted).sum(axis=1)))
        return angles

    return np.array([errors(place, yaw) for place, yaw in zip(places, yaws, strict=True)])


def _rms(errors: Array) -> float:
    return math.sqrt(float((errors**2).mean())) if errors.size else math.nan


def _converged(times: Array, errors: Array) -> float | None:
    """Return the time after which the rms first stays below twice the steady limit for 1 s, if
    it does."""
    good = np.sqrt((errors**2).mean(axis=1)) <= 2.0 * STEADY
    count = round(RATE)
    for k in range(len(good) - count):
        if good[k : k + count].all():
            return float(times[k])
    return None
