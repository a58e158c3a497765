"""The positions of base stations or beacons, found from the flight itself.

A wrong layout contradicts the IMU and itself, so that the error-state filter predicts sweeps and
bearings badly. The survey moves base stations (position and attitude) or beacons (position) until
the filter predicts best: a prediction-error method (Ljung, System Identification, 2nd ed., section
7.2). The IMU gives the scale. Without poses the layout as a whole remains undetermined: its
position, its heading and, unless the vehicle turns, its tilt, since a bias of the accelerometer
looks the same. It is then placed so that the flown path stays where it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import Beacons, parse_layout
from estimation.error_state.estimator import ErrorStateEstimator
from extensions.offline.lines import Run
from extensions.offline.run import Vehicle
from quadlab.recording.log import Arrival, Recording
from quadrotor.errors import MeasurementError
from quadrotor.records import MAX_BEACONS, POSE_SAMPLE, SWEEPS_SAMPLE, Array, Record

XYZW, WXYZ = (1, 2, 3, 0), (3, 0, 1, 2)
SPREAD = (0.1, 0.1, 0.1, 0.05, 0.05, 0.05)
"""m and rad: expected errors of position and attitude, one standard deviation."""
STEP = (1e-3, 1e-3, 1e-3, 5e-4, 5e-4, 5e-4)
"""m and rad: steps of the finite differences that approximate derivatives."""
CORRELATED = 5.0
"""Factor on the deviation of a measurement, because successive innovations are correlated."""
LARGE = 3.0
"""Number of deviations above which the cost of an innovation grows linearly, not quadratically."""
FARTHEST = 5.0
"""Largest move in multiples of SPREAD; the result of a survey with larger ones is refused."""
LEAST = 100
"""Least number of measurements for a survey."""
SETTLED_NS = 2_000_000_000
"""Nanoseconds after the filter's start from which its paths are compared."""
USUAL = 5
"""Number of steps that a survey usually takes."""
BLOCKS = 30
"""Number of blocks of a flight whose errors are assumed to be independent."""


class Place(NamedTuple):
    """A surveyed base station or beacon."""

    number: int
    moved_w: Array  # (3,) m
    turned_w: Array  # (3,) rad, rotation vector; zeros for a beacon
    deviation_w: Array  # (3,) m; NaN if the layout as a whole is undetermined


class Survey(NamedTuple):
    """The positions found, and the unpredicted part before and after, rad rms."""

    places: list[Place]
    before: float
    after: float

    @property
    def lines(self) -> list[str]:
        """Return a line for each place and one for the total."""
        lines = []
        for one in self.places:
            moved = ", ".join(f"{1e3 * along:.0f}" for along in one.moved_w)
            angle = math.degrees(float(np.linalg.norm(one.turned_w)))
            turned = f", turned by {angle:.2f}°" if angle else ""
            known = np.isfinite(one.deviation_w).all()
            sure = f" (± {1e3 * one.deviation_w.max():.0f} mm)" if known else ""
            lines.append(f"{one.number}: moved by {moved} mm{sure}{turned}")
        before, after = 1e3 * self.before, 1e3 * self.after
        return [*lines, f"residual: {before:.2f} mrad rms before, {after:.2f} mrad after"]


def survey_stations(recording: Recording, run: Run) -> Survey:
    """Find the positions of the base stations of recorded sweeps, and set them in `recording`.

    Raises MeasurementError when there are too few sweeps.
    """
    sweeps = np.concatenate([one.measurement for one in recording.sweeps])
    station = sweeps["number"] // 2
    numbers = np.unique(station).tolist()
    origins_w = np.array([sweeps["plane"]["origin_w"][station == n][0] for n in numbers])

    def arrivals(moved: Array) -> list[Arrival]:
        placed = sweeps.copy()
        origin, attitude = placed["plane"]["origin_w"], placed["plane"]["quaternion_wr"]
        for n, by in zip(numbers, moved.reshape(-1, 6), strict=True):
            of = station == n
            origin[of] += by[:3]
            turned = Rotation.from_rotvec(by[3:]) * Rotation.from_quat(attitude[of][:, XYZW])
            attitude[of] = turned.as_quat()[:, WXYZ]
        return [
            one._replace(measurement=placed[k : k + 1]) for k, one in enumerate(recording.sweeps)
        ]

    def fly(moved: Array) -> _Steady:
        return _Steady(recording, run, None).flown(arrivals(moved))

    moved, found = _fit(fly, origins_w, 6, numbers, run)
    recording.sweeps = arrivals(moved)
    return found


def survey_beacons(
    recording: Recording,
    run: Run,
    arrivals: list[Arrival],
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[Beacons, Survey]:
    """Return the positions of the beacons of the run's layout, to the mm, and how they were found.

    Args:
        progress: called with the share that is done, 0 to 1.

    Raises MeasurementError when there are too few frames of bearings, and when no layout fits
    better than the run's.
    """
    believed = parse_layout(run.parameters.beacons.layout)
    numbers = believed.ids.tolist()

    def placed(moved: Array) -> Beacons:
        return Beacons(numbers, (believed.positions_w + moved.reshape(-1, 3)).tolist())

    flights = 0

    def fly(moved: Array) -> _Steady:
        nonlocal flights
        flights += 1
        progress(min(0.99, flights / (USUAL * (moved.size + 1))))
        return _Steady(recording, run, placed(moved)).flown(arrivals)

    moved, found = _fit(fly, believed.positions_w, 3, numbers, run)
    return Beacons(numbers, placed(moved).positions_w.round(3).tolist()), found


class _Steady(Vehicle):
    """A replay with the stated noise, so that runs can be compared; stores its innovations."""

    def __init__(self, recording: Recording, run: Run, beacons: Beacons | None) -> None:
        self._surveyed = None if beacons is None else KnownBeacons(beacons)
        self.innovations: list[Array] = []  # rad
        self.sigma = 1.0
        super().__init__(recording, run)

    def flown(self, arrivals: list[Arrival]) -> _Steady:
        """Fly, and return this object."""
        states = self.fly(arrivals).states
        stamps = self._recording.imu["stamp_ns"]
        started = self._out.started_ns
        settled = stamps[-1] if started is None else started + SETTLED_NS
        self.path_w = np.where((stamps > settled)[:, None], states["position_w"], np.nan)
        return self

    def _configure(self) -> None:
        super()._configure()
        self._beacons = self._surveyed or self._beacons

    def _take(self, measurement: Record, now_ns: int) -> None:
        estimator = self._estimator
        assert isinstance(estimator, ErrorStateEstimator)
        memory, known = estimator.memory[0], estimator.initialized
        memory["evidence"], memory["noise_scale"] = 0.0, 1.0
        super()._take(measurement, now_ns)
        if measurement.dtype == POSE_SAMPLE:
            return
        self.sigma, count = float(measurement["sigma"][0]), int(measurement["count"][0])
        sweeps = measurement.dtype == SWEEPS_SAMPLE
        row = np.zeros(1 if sweeps else 2 * MAX_BEACONS)
        if known and sweeps:
            # The mean: adjacent sensors differ by their own errors, not by their distance.
            row[0] = memory["rest"][:count].mean()
        elif known:
            row[: 2 * count] = memory["rest"][: 2 * count]
        self.innovations.append(row)

    def _note(self, now_ns: int, raised: bool, applied: bool) -> None:
        """Note only the start, as a survey flies a hundred times and needs nothing else."""
        self._note_start(now_ns)


def _fit(
    fly: Callable[[Array], _Steady], places_w: Array, each: int, numbers: list[int], run: Run
) -> tuple[Array, Survey]:
    """Return the moves of each place, (B, each), and the survey with the results."""
    size, scale = each * len(numbers), np.tile(SPREAD[:each], len(numbers))
    step = np.tile(STEP[:each], len(numbers))
    first = fly(np.zeros(size))
    if len(first.innovations) < LEAST or np.isnan(first.path_w).all():
        raise MeasurementError(
            f"{len(first.innovations)} sweeps or frames of bearings in {run.label!r} are too few "
            f"for a survey, which needs {LEAST} and a filter that starts: replay a longer flight"
        )

    @lru_cache(maxsize=1)
    def innovations(moved: bytes) -> Array:
        flown = fly(np.array(np.frombuffer(moved)))
        return np.concatenate(flown.innovations) / (CORRELATED * flown.sigma)

    def residual(moved: Array) -> Array:
        unexpected = innovations(moved.tobytes())
        absolute = np.abs(unexpected)
        large = np.sqrt(np.maximum(LARGE * (2.0 * absolute - LARGE), 0.0))
        weighed = np.sign(unexpected) * np.where(absolute > LARGE, large, absolute)
        return np.concatenate([weighed, moved / scale])

    def derivatives(moved: Array) -> Array:
        there = residual(moved)
        shifted = zip(np.diag(step), step, strict=True)
        return np.column_stack([(residual(moved + one) - there) / h for one, h in shifted])

    found = least_squares(residual, np.zeros(size), derivatives, ftol=1e-6, xtol=1e-2, max_nfev=12)
    moves = found.x
    if run.source == "both":
        # Few or noisy bearings are pulled towards the assumed places; one step from where they are
        # now, with the same Jacobian, removes most of that (iterated Tikhonov regularisation).
        moves = moves + np.linalg.solve(found.jac.T @ found.jac, moves / scale**2)
    moved, last = moves.reshape(-1, each), fly(moves)
    deviations = np.full((len(numbers), 3), np.nan)
    if run.source == "both":
        deviations = _deviations(found.jac, found.fun).reshape(-1, each)[:, :3]
    else:
        moved = _in_place(places_w, moved, first.path_w, last.path_w)
    moved[:, :3] = (places_w + moved[:, :3]).round(3) - places_w
    # Of the proposed, rounded layout, not of the fitted one.
    rms = [_rms(np.concatenate(one.innovations)) for one in (first, fly(moved.ravel()))]
    if not ((np.abs(moves) < FARTHEST * scale).all() and rms[1] < rms[0]):
        raise MeasurementError(
            f"the survey of {run.label!r} finds no layout near the one it began with that fits "
            f"better: {1e3 * rms[1]:.2f} instead of {1e3 * rms[0]:.2f} mrad of residual, moved "
            f"by up to {np.abs(moved[:, :3]).max():.2f} m; is the layout right to about 0.1 m, and "
            "does the flight have 20 s or more of strong motion?"
        )
    turned = np.zeros_like(deviations) if each == 3 else moved[:, 3:]
    places = map(Place, numbers, moved[:, :3], turned, deviations)
    return moved, Survey(list(places), *rms)


def _rms(innovations: Array) -> float:
    return float(np.sqrt(np.mean(innovations[innovations != 0.0] ** 2)))


def _deviations(jacobian: Array, residual: Array) -> Array:
    """Return the standard deviations of the parameters, with correlated innovations within a block
    of the flight counted as one (the sandwich estimator of clustered errors).
    """
    bend = np.linalg.inv(jacobian.T @ jacobian)
    blocks = zip(np.array_split(jacobian, BLOCKS), np.array_split(residual, BLOCKS), strict=True)
    pulls = np.array([rows.T @ rest for rows, rest in blocks])
    return np.asarray(np.sqrt(np.diag(bend @ pulls.T @ pulls @ bend)), np.float64)


def _in_place(places_w: Array, moved: Array, before_w: Array, after_w: Array) -> Array:
    """Return the moves, with the layout as a whole placed so that the path stays where it was."""
    both = np.isfinite(before_w).all(axis=1) & np.isfinite(after_w).all(axis=1)
    before, after = before_w[both], after_w[both]
    turn, _ = Rotation.align_vectors(before - before.mean(axis=0), after - after.mean(axis=0))
    out = moved.copy()
    placed = places_w + moved[:, :3] - after.mean(axis=0)
    out[:, :3] = turn.apply(placed) + before.mean(axis=0) - places_w
    if moved.shape[1] > 3:
        out[:, 3:] = (turn * Rotation.from_rotvec(moved[:, 3:])).as_rotvec()
    return out
