"""Trajectories: the cost of a sample, the cost of the check before a start, and the snap."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from benchmarks.harness import Report, Row, Size, Target, time_in_turns
from control.behaviors.behavior import Context
from control.behaviors.follow_trajectory import FollowTrajectory
from control.behaviors.parameters import BehaviorParameters
from control.trajectories.circle import Circle
from control.trajectories.feasibility import examine
from control.trajectories.figure_eight import FigureEight
from control.trajectories.limits import Limits
from control.trajectories.line import Line
from control.trajectories.minimum_snap import minimum_snap
from control.trajectories.polynomial import ORDER, Polynomial, hermite
from control.trajectories.trajectory import Surveyed
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import REFERENCE, new_reference
from quadrotor.vehicle_model import VehicleModel

Array = npt.NDArray[np.float64]

GRID = 20_000
STARTS: dict[str, dict[str, ParameterValue]] = {
    "figure_eight": {},
    "circle": {"nose": "tangent"},
    "line": {"x": 2.0, "yaw": 2.0},
    "waypoints": {"waypoints": "1 0 1 1; 1 1 1.5; 0 1 1; -1 0 1 0"},
    "figure_eight, refused": {"period": 3.0},
}


def run(size: Size = Size.FULL) -> Report:
    """Return times and costs; seeds are fixed."""
    rounds = size.of(9, 3, 1)
    rng = np.random.default_rng(7)
    points = np.column_stack(
        [rng.uniform((-1.5, -1.5, 0.5), (1.5, 1.5, 3.5), (8, 3)), rng.normal(size=8)]
    )
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(1.0, 2.5, 7))])
    least, joined = minimum_snap(points, times), through(points, times)
    report = Report(
        "trajectories",
        "Trajectories",
        [
            f"one sample: position to snap and yaw to acceleration, mean of a grid of {GRID}",
            "one tick: one sample asked from Python",
            "check: all extremes through the inverse dynamics, and their times",
            "start: arguments, path and check of follow_trajectory; 2 ms is a period at 500 Hz",
        ],
    )
    paths: dict[str, Surveyed] = {
        "figure of eight, 3 laps": FigureEight((0.0, 0.0, 1.0)),
        "circle, nose along the tangent": Circle((0.0, 0.0, 1.0, 0.0), nose="tangent"),
        "line": Line((0.0, 0.0, 1.0, 0.0), (2.0, 1.0, 1.5, 1.0), speed=1.0, acceleration=2.0),
        "least snap, 8 way-points": least,
    }
    grid, one = np.zeros(GRID, REFERENCE), new_reference()
    model, limits = VehicleModel().record(), Limits()
    for name, path in paths.items():
        methods: dict[str, tuple[Callable[[], object], int]] = {
            "sample": (lambda p=path: p.sample_grid(1.0, 1e-4, grid), 2),  # type: ignore[misc]
            "tick": (lambda p=path: p.sample(1.0, one), 2000),  # type: ignore[misc]
            "check": (lambda p=path: examine(p, model, limits), 20),  # type: ignore[misc]
        }
        t = time_in_turns(methods, rounds)
        report.rows.append(
            Row(
                name,
                {
                    "one sample (ns)": 1e9 * t["sample"].median / GRID,
                    "one tick (µs)": 1e6 * t["tick"].median,
                    "check (ms)": 1e3 * t["check"].median,
                },
            )
        )
    _starts(report, rounds)
    for name, path in (("least snap", least), ("Catmull-Rom velocities", joined)):
        report.rows.append(
            Row(f"{name}, same points and times", {"∫ snap² (m²/s⁷)": snap_cost(path)})
        )
    ratio = snap_cost(least) / snap_cost(joined)
    report.targets.append(Target("snap cost over that of Catmull-Rom velocities", ratio, 0.9))
    return report


def _starts(report: Report, rounds: int) -> None:
    reference = new_reference()
    reference["position_w"][0, 2] = 1.2
    context = Context(reference, BehaviorParameters(), 12.8)

    def start(name: str, arguments: dict[str, ParameterValue]) -> None:
        try:
            FollowTrajectory.start(context, {"trajectory": name.partition(",")[0], **arguments})
        except RefusedError:
            if "refused" not in name:
                raise

    methods: dict[str, tuple[Callable[[], object], int]] = {
        name: (lambda n=name, a=arguments: start(n, a), 10)  # type: ignore[misc]
        for name, arguments in STARTS.items()
    }
    found = time_in_turns(methods, rounds)
    for name, timing in found.items():
        report.rows.append(Row(f"start {name}", {"start (ms)": 1e3 * timing.median}))
    slowest = max(t.median for name, t in found.items() if "refused" not in name)
    report.targets.append(Target("slowest start of those accepted (ms)", 1e3 * slowest, 1.0))


def through(waypoints: Array, times: Array) -> Polynomial:
    """Return a polynomial from rest through the way-points to rest.

    Velocities in between are those of a Catmull-Rom spline; higher derivatives are zero there.

    Args:
        waypoints: (S + 1, 4) x, y, z (m), yaw (rad, not wrapped).
        times: (S + 1,) s, from 0, increasing.
    """
    points, at = np.asarray(waypoints, dtype=float), np.asarray(times, dtype=float)
    motion = np.zeros((len(at), 4, 5))
    motion[:, :, 0] = points
    motion[1:-1, :, 1] = (points[2:] - points[:-2]) / (at[2:] - at[:-2])[:, None]
    pieces = [hermite(motion[k], motion[k + 1], at[k + 1] - at[k]) for k in range(len(at) - 1)]
    return Polynomial(at, np.stack(pieces))


def snap_cost(path: Polynomial) -> float:
    """Return the integral of the squared snap (m^2/s^7)."""
    power = np.arange(ORDER + 1)
    falling = np.array([math.perm(n, 4) for n in power], dtype=float)
    exponent = np.maximum(power[:, None] + power[None, :] - 7, 1)
    weights = np.outer(falling, falling) / exponent
    c = path.coefficients[:, :3]
    each = np.einsum("sim,mn,sin->s", c, weights, c)
    return float((each * np.diff(path.times) ** -7.0).sum())
