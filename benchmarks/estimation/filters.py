"""Accuracy of filters on bearings, compared with the posterior Cramér-Rao bound, and their time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from benchmarks.estimation.bound import START, bound
from benchmarks.estimation.filter_peers import peers
from benchmarks.estimation.flights import (
    BEACONS,
    FORCE_BIAS,
    FORCE_NOISE,
    RATE,
    RATE_BIAS,
    RATE_NOISE,
    SIGMA,
    Flight,
    flight,
    quaternion,
)
from benchmarks.harness import Report, Row, Size, Target
from estimation.complementary import ComplementaryEstimator
from estimation.error_state.estimator import ErrorStateEstimator
from estimation.error_state_parameters import ErrorStateParameters
from estimation.estimator import Estimator
from estimation.history import recall
from estimation.parameters import PRESETS, EstimationParameters
from estimation.poses.planar_pose import planar_pose
from quadrotor.errors import MeasurementError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    IMU_SAMPLE,
    POSE_SAMPLE,
    STATE,
    Array,
    Record,
    new_state,
)

DURATION, DISCARDED = 75.0, 35.0  # s
EPOCH_NS = 1_000_000_000


@dataclass
class Flown:
    """The estimates of one method on one flight."""

    states: Record
    seconds: float  # of processor time per second of flight
    nis: float = 0.0  # normalised innovations squared, summed after the discarded time
    freedom: int = 0


@dataclass
class Accuracy:
    """Squared errors and times over flights."""

    squares: list[Array] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    nis: float = 0.0
    freedom: int = 0

    def add(self, truth: Flight, flown: Flown) -> None:
        self.squares.append(squares(truth, flown.states))
        self.seconds.append(flown.seconds)
        self.nis += flown.nis
        self.freedom += flown.freedom

    @property
    def rms(self) -> Array:
        """Return rms errors in m, m/s, rad over all flights."""
        out: Array = np.sqrt(np.mean(self.squares, axis=0))
        return out


class OneFrame(ComplementaryEstimator):
    """The complementary filter on refined one-frame poses, without solving the position again."""

    def correct_bearings(self, bearings: Record, estimate: Record) -> None:
        frame, start = bearings[0], None
        if self.initialized and recall(self.memory[0], int(frame["stamp_ns"])) > 0:
            past = self.memory["past"][0].copy()
            start = (past[:3], past[3:])
        try:
            pose = planar_pose(frame["beacon_w"][:4], frame["bearing_b"][:4], SIGMA, start)
        except MeasurementError:
            return  # the filter with the paper's gains diverges at times; the next frame may fit
        sample = np.zeros(1, POSE_SAMPLE)
        sample[0] = frame["stamp_ns"], pose.position_w, pose.quaternion_wb
        self.correct(sample, estimate)


def error_state() -> ErrorStateEstimator:
    """Return an estimator with the true noise and the deviations of the drawn biases."""
    parameters = EstimationParameters(measurement_timeout=0.2)
    parameters.error_state = ErrorStateParameters(
        accelerometer_noise=FORCE_NOISE / np.sqrt(RATE),
        gyroscope_noise=np.degrees(RATE_NOISE) / np.sqrt(RATE),
        accelerometer_bias_walk=1e-4,
        gyroscope_bias_walk=1e-4,
    )
    return ErrorStateEstimator(parameters)


def complementary(preset: str, kind: type[ComplementaryEstimator]) -> Callable[[], Estimator]:
    parameters = EstimationParameters.model_validate(PRESETS[preset])
    parameters.measurement_timeout = 0.2
    parameters.pose_position_noise, parameters.pose_attitude_noise = 0.1, 5.0  # of one frame
    return lambda: kind(parameters)


KALMAN = "error-state filter"
METHODS: dict[str, Callable[[], Estimator]] = {
    KALMAN: error_state,
    "complementary, paper's gains": complementary("paper", OneFrame),
    "complementary, retuned": complementary("bearings", OneFrame),
    "complementary, position solved anew": complementary("resolved", ComplementaryEstimator),
}


def fly(truth: Flight, estimator: Estimator, delay: float = 0.0, stamped: bool = True) -> Flown:
    """Run an estimator over one flight.

    Args:
        delay: s by which frames arrive late.
        stamped: whether frames are stamped with the time of their measurement rather than arrival.
    """
    imu, frame = np.zeros(1, IMU_SAMPLE), np.zeros(1, BEARINGS_SAMPLE)
    estimate, state, states = np.zeros(1, ESTIMATE), new_state(), np.zeros(len(truth.t), STATE)
    frame["count"], frame["sigma"], frame["beacon_w"][0, :4] = 4, SIGMA, BEACONS
    waiting, flown = list(reversed(truth.frames)), Flown(states, 0.0)
    kalman = estimator if isinstance(estimator, ErrorStateEstimator) else None
    spent = 0.0
    for k, t in enumerate(truth.t.tolist()):
        imu["stamp_ns"] = round(t * 1e9) + EPOCH_NS
        imu["angular_velocity_b"], imu["specific_force_b"] = (
            truth.sample[k, :3],
            truth.sample[k, 3:],
        )
        began = time.perf_counter()
        estimator.predict(imu, 1.0 / RATE, state)
        spent += time.perf_counter() - began
        states[k] = state[0]
        while waiting and waiting[-1].t + delay <= t:
            one = waiting.pop()
            stamp = one.t if stamped else one.t + delay
            frame["stamp_ns"] = round(stamp * 1e9) + EPOCH_NS
            frame["bearing_b"][0, :4] = one.bearings_b
            if kalman is not None and not kalman.initialized:
                kalman.initialize(_first_pose(frame), deviations=ORDER_OF_FILTER)
                continue
            began = time.perf_counter()
            estimator.correct_bearings(frame, estimate)
            spent += time.perf_counter() - began
            if kalman is not None and t > DISCARDED:
                flown.nis += float(kalman.memory["nis"][0])
                flown.freedom += int(kalman.memory["freedom"][0])
    flown.seconds = spent / float(truth.t[-1])
    return flown


# The bound's order is position, velocity, attitude; the filter's is position, attitude, velocity.
ORDER_OF_FILTER = START[[0, 1, 2, 6, 7, 8, 3, 4, 5, *range(9, 15)]]


def _first_pose(frame: Record) -> Record:
    pose = planar_pose(frame["beacon_w"][0, :4], frame["bearing_b"][0, :4], SIGMA)
    sample = np.zeros(1, POSE_SAMPLE)
    sample[0] = frame["stamp_ns"][0], pose.position_w, pose.quaternion_wb
    return sample


def squares(truth: Flight, states: Record) -> Array:
    """Return the mean squared errors of position, velocity, attitude after the discarded time."""
    used = truth.t > DISCARDED
    w, x, y, z = states["quaternion_wb"][used].T
    tw, tx, ty, tz = quaternion(truth.R_wb[used]).T
    share = np.abs(w * tw + x * tx + y * ty + z * tz)
    angle = 2.0 * np.arccos(np.minimum(1.0, share))
    # arccos is insensitive near 1, so the vector part is used there.
    vector = np.stack(
        [
            tw * x - tx * w - ty * z + tz * y,
            tw * y - ty * w - tz * x + tx * z,
            tw * z - tz * w - tx * y + ty * x,
        ]
    )
    angle = np.where(share > 0.99, 2.0 * np.linalg.norm(vector, axis=0), angle)
    return np.array(
        [
            ((states["position_w"] - truth.position_w)[used] ** 2).sum(axis=1).mean(),
            ((states["velocity_w"] - truth.velocity_w)[used] ** 2).sum(axis=1).mean(),
            (angle**2).mean(),
        ]
    )


def run(size: Size = Size.FULL) -> Report:
    """Run bound and error-state filter on many flights, the others on the first of them."""
    many, count = size.of((64, 16), (8, 4), (1, 1))
    duration = size.of(DURATION, DURATION, DISCARDED + 1.0)
    report = Report(
        "filters",
        "Filters on bearings: accuracy and time",
        [
            f"{many} flights (bound, error-state filter; the others fly the first {count}, peers "
            f"the first 2) of {duration:g} s at 0.75 m/s rms within |x|, |y| ≤ 1.5 m, "
            f"0.3 ≤ z ≤ 2 m; the first {DISCARDED:g} s of each are left out for the slowest "
            "filter's biases to converge",
            f"IMU 500 Hz, white noise {FORCE_NOISE:g} m/s² and {np.degrees(RATE_NOISE):g} deg/s a "
            f"sample, constant biases drawn with {RATE_BIAS:g} rad/s and {FORCE_BIAS:g} m/s²",
            "30 Hz bearings to 4 beacons, 1.5 deg on each of two tangent axes",
            "errors are rms lengths of the error vectors; time is processor time a second of "
            "flight, Python calls included",
        ],
    )
    for make in METHODS.values():  # compile
        fly(flight(999, 1.0), make())
    found = {name: Accuracy() for name in METHODS}
    late = {stamped: Accuracy() for stamped in (False, True)}
    bounds = []
    for seed in range(many):
        truth = flight(seed, duration)
        bounds.append(bound(truth)[truth.t > DISCARDED].mean(axis=0))
        for name, make in METHODS.items():
            if seed < count or name == KALMAN:
                found[name].add(truth, fly(truth, make()))
        if seed >= count:
            continue
        for stamped, accuracy in late.items():
            accuracy.add(truth, fly(truth, error_state(), 0.02, stamped))
    limit = np.sqrt(np.mean(bounds, axis=0))
    report.rows.append(_row("posterior Cramér-Rao bound", limit, limit, None))
    # Each is compared with the bound of the same flights.
    same = np.sqrt(np.mean(bounds[:count], axis=0))
    for name, accuracy in found.items():
        of = limit if name == KALMAN else same
        report.rows.append(_row(name, accuracy.rms, of, accuracy.seconds))
    report.rows.append(
        _row("error-state, bearings 20 ms late, stamped", late[True].rms, same, late[True].seconds)
    )
    report.rows.append(
        _row("error-state, 20 ms late, delay unknown", late[False].rms, same, late[False].seconds)
    )
    peer_rows, notes = peers(
        [flight(seed, duration) for seed in range(2)],
        DISCARDED,
        METHODS["complementary, position solved anew"],
        fly,
    )
    report.rows += peer_rows
    report.notes += notes
    _targets(report, found, late, limit, bounds)
    timed = [row for row in report.rows if "µs a second" in row.figures and "m" in row.figures]
    report.plot = {
        "kind": "scatter",
        "x": [row.figures["µs a second"] for row in timed],
        "y": [row.figures["m"] for row in timed],
        "labels": [row.method for row in timed],
        "x_label": "processor time, µs a second of flight",
        "y_label": "position error, m rms",
        "limit": float(limit[0]),
        "limit_label": "posterior Cramér-Rao bound",
    }
    return report


def _row(method: str, rms: Array, limit: Array, seconds: list[float] | None) -> Row:
    figures: dict[str, float | str] = {
        "m": float(rms[0]),
        "m/s": float(rms[1]),
        "deg": float(np.degrees(rms[2])),
        "× bound": " / ".join(f"{ratio:.2f}" for ratio in rms / limit),
    }
    if seconds is not None:
        figures["µs a second"] = 1e6 * float(np.median(seconds))
    return Row(method, figures)


def _targets(
    report: Report,
    found: dict[str, Accuracy],
    late: dict[bool, Accuracy],
    limit: Array,
    bounds: list[Array],
) -> None:
    kalman = found[KALMAN]
    for what, ratio in zip(("position", "velocity", "attitude"), kalman.rms / limit, strict=True):
        report.targets.append(Target(f"error-state filter, {what}, × bound", float(ratio), 1.08))
    report.targets.append(
        Target("unmodelled 20 ms delay, position, m", float(late[False].rms[0]), 0.03)
    )
    report.targets.append(Target("the same stamped, m", float(late[True].rms[0]), 0.014))
    best = found["complementary, position solved anew"].rms
    for what, value, most in (
        ("m", best[0], 0.02),
        ("m/s", best[1], 0.035),
        ("deg", np.degrees(best[2]), 0.4),
    ):
        report.targets.append(Target(f"best complementary, {what}", float(value), most))
    low, high = chi2.ppf([0.025, 0.975], kalman.freedom) / kalman.freedom
    mean = kalman.nis / kalman.freedom
    report.targets.append(Target("mean NIS a degree of freedom", mean, float(high)))
    report.targets.append(Target("mean NIS a degree of freedom", mean, float(low), at_most=False))
    spread = _spread(np.array(kalman.squares), np.array(bounds))
    report.notes.append(
        "standard error of the error-state filter's ratios to the bound, over flights: "
        + ", ".join(f"{one:.3f}" for one in spread)
    )
    report.notes.append(
        f"normalised innovations squared: {mean:.4f} a degree over {kalman.freedom} degrees, "
        f"95 % bounds {low:.4f} … {high:.4f}"
    )


def _spread(squares: Array, bounds: Array) -> Array:
    """Return the standard error (3,) of the ratio of rms values, by bootstrap over the flights."""
    random = np.random.default_rng(0)
    drawn = random.integers(0, len(squares), (500, len(squares)))
    out: Array = np.sqrt(squares[drawn].mean(axis=1) / bounds[drawn].mean(axis=1)).std(axis=0)
    return out
