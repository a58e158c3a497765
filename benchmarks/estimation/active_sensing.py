"""The worth of a path that looks around: time to a given sigma, and sigma at the end, on bearings.

A point vehicle with yaw flies its own estimate along paths of several kinds within 1 m of its
start, at up to 1 m/s and 2 m/s^2, on 4, 3 or 2 beacons, or beside a neighbour of its formation. The
sigma to be reached is that of the median straight flight after REFERENCE s.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from benchmarks.estimation.sensing_flights import RATE, SIGMA, Case, Outcome, Path, fly
from benchmarks.harness import Report, Row, Size, Target
from quadrotor.records import Array

BEACONS = np.array([[1.0, 1.0, 0.1], [1.0, -1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1]])
SEEN = {
    "4 beacons": BEACONS,
    "3 beacons": BEACONS[:3],
    "2 beacons": BEACONS[:2],
    "a neighbour": np.array([[0.0, 0.0, 1.0]]),
}
DURATION = 10.0
REFERENCE = 6.0
"""s after the start of the straight flights whose sigma is to be reached."""
END = 2.0
"""s at the end over which the error is taken: four plans."""
MOTION = {"0.01": 0.01, "0.002": 0.002}
"""m/sqrt(s), noise of the motion: about that of IMU and bearings together, and of good odometry."""
SAMPLES = 2000
Chosen = npt.NDArray[np.int_]


def run(size: Size = Size.FULL) -> list[Report]:
    """Fly all paths, and return a report for each noise of the motion."""
    count = size.of(200, 40, 3)
    return [_report(name, noise, count) for name, noise in size.some(MOTION.items())]


def _report(name: str, noise: float, count: int) -> Report:
    report = Report(
        f"active_sensing_{name}".replace(".", "_"),
        f"Paths that look around, motion known to {name} m/√s",
        [
            f"{count} flights of {DURATION:g} s a row, the same starts and noise on each path; "
            f"bearings {RATE:g} Hz, {math.degrees(SIGMA):g}°; start known to 0.3 m, 10°",
            "point vehicle in R³ × S¹ with extended Kalman filter; within 1 m of the start, 1 m/s, "
            "2 m/s²; beacons (±1, ±1, 0.1) m, starts in ±1.2 m, 0.5–1.8 m; neighbour 2 m away",
            f"σ to be reached: of the median straight flight after {REFERENCE:g} s; a flight that "
            f"does not reach it counts {DURATION:g} s",
            "ratios of straight to this path, geometric mean of times a flight and of rms errors, "
            "with 95 % bootstrap interval",
        ],
    )
    for seen, landmarks in SEEN.items():
        case = Case(landmarks, seen == "a neighbour", noise)
        starts = _starts(case, count)
        flown = {path: fly(path, case, starts, DURATION, seed=1) for path in Path}
        straight = flown[Path.STRAIGHT]
        wanted = float(np.median(straight.sigma[:, round(REFERENCE * RATE)]))
        for path, outcome in flown.items():
            report.rows.append(_row(f"{seen}: {path}", outcome, straight, wanted))
        if seen == "3 beacons":
            faster = _times(straight, wanted) / _times(flown[Path.LOOK_AROUND], wanted)
            report.targets.append(
                Target(
                    "time to σ on 3 beacons, straight over look_around",
                    float(np.exp(np.log(faster).mean())),
                    2.0,
                    at_most=False,
                )
            )
    return report


def _starts(case: Case, count: int) -> Array:
    rng = np.random.default_rng(7)
    if case.mutual:
        angle = rng.uniform(-math.pi, math.pi, count)
        return np.column_stack(
            [2.0 * np.cos(angle), 2.0 * np.sin(angle), rng.uniform(0.7, 1.3, count)]
        )
    return np.column_stack([rng.uniform(-1.2, 1.2, (count, 2)), rng.uniform(0.5, 1.8, count)])


def _row(method: str, outcome: Outcome, straight: Outcome, wanted: float) -> Row:
    times, reference = _times(outcome, wanted), _times(straight, wanted)
    last = round(END * RATE)
    squares, others = ((one.error[:, -last:] ** 2).mean(axis=1) for one in (outcome, straight))
    bound = (outcome.bound[:, -last:] ** 2).mean()
    return Row(
        method,
        {
            "σ to reach (cm)": 100.0 * wanted,
            "median time to it (s)": float(np.median(times)),
            "reached (%)": 100.0 * float((times < DURATION).mean()),
            "straight's time / its": _ratio(
                len(times), lambda k: math.exp(float(np.log(reference[k] / times[k]).mean()))
            ),
            "rms error at the end (cm)": 100.0 * math.sqrt(float(squares.mean())),
            "straight's error / its": _ratio(
                len(times), lambda k: math.sqrt(float(others[k].mean() / squares[k].mean()))
            ),
            "error / bound": _ratio(
                len(times), lambda k: math.sqrt(float(squares[k].mean() / bound))
            ),
            "normalised square of 4": float(outcome.square.mean()),
        },
    )


def _times(outcome: Outcome, wanted: float) -> Array:
    """Return when each flight's sigma has first come to `wanted`, s."""
    reached = outcome.sigma <= wanted
    first = np.where(reached.any(axis=1), reached.argmax(axis=1) + 1, outcome.sigma.shape[1])
    return np.asarray(first / RATE)


def _ratio(count: int, of: Callable[[Chosen], float]) -> str:
    """Return a ratio of flights with its 95 % bootstrap interval."""
    rng = np.random.default_rng(0)
    found = [of(rng.integers(0, count, count)) for _ in range(SAMPLES)]
    low, high = np.percentile(found, [2.5, 97.5])
    return f"{of(np.arange(count, dtype=np.int_)):.2f} ({low:.2f}–{high:.2f})"
