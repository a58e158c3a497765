"""The courses of the arena."""

from __future__ import annotations

from functools import partial

import numpy as np

from control.trajectories.circle import Circle
from control.trajectories.figure_eight import FigureEight
from control.trajectories.minimum_snap import minimum_snap
from control.trajectories.trajectory import Trajectory, grid_sampler
from quadrotor.errors import UsageError
from quadrotor.records import REFERENCE, Record

PERIOD = 0.002
"""s, of a tick."""
CENTRE = (0.0, 0.0, 1.5)
START = (*CENTRE, 0.0)
MOTION = "position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"
STEP, HELD, STEPS = 0.5, 3.0, 6
"""m of a step of the reference, s between two, and their number."""


class Course:
    """A trajectory of one REFERENCE record for each tick."""

    def __init__(self, rows: Record) -> None:
        self._rows = rows
        self.duration = PERIOD * (len(rows) - 1)

    def sample(self, t: float, reference: Record) -> None:
        """Write the record of the tick at t (s); the ends are held."""
        reference[0] = self._rows[min(max(0, round(t / PERIOD)), len(self._rows) - 1)]


def courses() -> dict[str, Trajectory]:
    """Return the courses: the 8 of the paper slow, fast and so large and fast that motors saturate,
    and courses of the literature at this vehicle's scale.

    The upright 8 is that of O'Connell et al. 2022 (Neural-Fly), who fly through random points too;
    the 8 of 20 m, the hypotrochoid and the dashes are of the kinds of Sun et al. 2022. The steps
    have no feed-forward: their error is that of the transients.
    """
    eight = partial(FigureEight, CENTRE, laps=6, ramp=6.0)
    large = partial(eight, width=3.0, height=1.5)
    level = partial(eight, z_amplitude=0.0, yaw_amplitude=0.0)
    circle = partial(Circle, START, ramp=4.0)
    rolling = Circle((0.0, 0.0, 0.0, 0.0), radius=0.3, side="right", period=1.5, laps=16, ramp=4.0)
    places = np.random.default_rng(1).uniform((-1.5, -1.5, 1.0), (1.5, 1.5, 2.0), (12, 3)).tolist()
    dashes = [[x, 0.0, 1.5] for x in (2.5, -2.5) * 4]
    made = {
        "upright 8, 2.5 m x 1.5 m in 6.28 s": _upright(level(width=2.5, height=1.5, period=6.28)),
        "random points": _through(places, 1.5),
        "circle of 1 m in 3 s": _rows(circle(radius=1.0, period=3.0, laps=8)),
        "helix, nose ahead": _rows(circle(period=4.0, laps=6, rise=0.3, nose="tangent")),
        "hypotrochoid": _summed(circle(radius=1.2, period=6.0, laps=4), rolling),
        "20 m x 10 m in 11 s": _rows(level(width=20.0, height=10.0, period=11.0, laps=2)),
        "dashes of 5 m": _through(dashes, 2.2),
        "steps": _steps(),
    }
    return {
        "8 in 8 s": FigureEight(CENTRE),
        "8 in 4 s": eight(period=4.0, ramp=4.0, yaw_amplitude=0.3),
        "3 m x 1.5 m in 4 s": large(period=4.0, yaw_amplitude=0.2),
        "3 m x 1.5 m in 3 s": large(period=3.0, yaw_amplitude=0.1),
        **{name: Course(rows) for name, rows in made.items()},
    }


def chosen_courses(names: str) -> dict[str, Trajectory]:
    """Return the courses of these names, separated by semicolons; for none, all.

    Raises UsageError.
    """
    there = courses()
    wanted = [name.strip() for name in names.split(";") if name.strip()]
    for name in wanted:
        if name not in there:
            raise UsageError(
                f"--courses {name!r} is not in the arena; there are {'; '.join(there)}"
            )
    return {name: there[name] for name in wanted or there}


def _rows(trajectory: Trajectory) -> Record:
    rows = np.zeros(round(trajectory.duration / PERIOD) + 1, REFERENCE)
    grid_sampler(trajectory)(0.0, PERIOD, rows)
    return rows


def _upright(level: Trajectory) -> Record:
    """Return a level course about CENTRE, turned into the plane of x and z."""
    rows = _rows(level)
    for name in MOTION:
        rows[name][:, 2], rows[name][:, 1] = rows[name][:, 1], 0.0
    rows["position_w"] += (0.0, CENTRE[1], CENTRE[2] - CENTRE[1])
    return rows


def _summed(one: Trajectory, other: Trajectory) -> Record:
    """Return the motion of a trajectory and, added to it, that of one as long about the origin."""
    rows, more = _rows(one), _rows(other)
    for name in MOTION:
        rows[name] += more[name]
    return rows


def _through(places: list[list[float]], spacing: float) -> Record:
    """Return the path of minimum snap from CENTRE through places, one every `spacing` s."""
    points = np.array([START, *((*place, 0.0) for place in places), START])
    return _rows(minimum_snap(points, spacing * np.arange(len(points), dtype=np.float64)))


def _steps() -> Record:
    rows = np.zeros(round(HELD * STEPS / PERIOD) + 1, REFERENCE)
    away = np.arange(len(rows)) * PERIOD // HELD % 2
    rows["position_w"] = CENTRE
    rows["position_w"][:, 0] += STEP * away
    return rows
