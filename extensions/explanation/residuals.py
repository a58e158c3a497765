"""Residuals of a flight's poses against the motion that its IMU felt or its motors made.

Over a window of some seconds the poses are compared with twice integrated accelerations: those that
the accelerometer felt, and those that the commanded thrust causes by the model. Each cause leaves a
residual of a shape of its own (least squares):

    p(t) - ∫∫a dt² = p0 + v0 t + a0 t²/2 + j0 t³/6 - d v(t) + s ∫∫a dt²   by the IMU
    p(t) - ∫∫a dt² = p0 + v0 t + a0 t²/2 + j0 t³/6 - k ∫∫v dt²            by the motors

with the acceleration a0 that is missing, the scale 1 + s of the poses, their delay d against their
stamps, and the drag k over the mass.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from console.evaluation.findings import Array, Parameters, Spans, Topics
from extensions.explanation.blocks import has, number
from flight_log.fields import FORCE, RATE, TRACKED, TRACKED_ATTITUDE
from quadrotor.constants import GRAVITY
from quadrotor.plain_rotations import make_continuous, matrices_of, rotation_vectors_between

WINDOW, STEP = 6.0, 2.0
"""Length of a window and time between two, in s."""
LEAST_POSES = 40
"""Number of poses in a window below which nothing is fitted."""
PARTS = 5
"""Number of parts of a window in which the gyroscope is compared."""
LEAST_SHARE = 0.8
"""Share of a window's IMU samples that must be there."""
STEADY = 0.05
"""Largest rms in m of what the fit leaves; beyond it no cause below explains the poses."""
OUTLYING = 4.0
"""Distance from the fit, in robust standard deviations, beyond which a pose is left out."""


@dataclass(frozen=True)
class Fit:
    """Residuals of one window, by IMU or by motors.

    Attributes:
        acceleration_w: acceleration in m/s² that the source does not have, (3,), world axes.
        ending_w, ending_b: the same at the window's end, where it is larger if it grows; world
            and body axes.
        delay, scale: in s, and as a share; 0 by the motors.
        drag: in 1/s beyond the model's; 0 by the IMU.
        rms: in m, of the poses against the fit.
    """

    acceleration_w: Array
    ending_w: Array
    ending_b: Array
    delay: float
    scale: float
    drag: float
    rms: float


@dataclass(frozen=True)
class Window:
    """The residuals of the poses of one window.

    Attributes:
        start: in s since the run's first message.
        imu, motors: by the accelerometer, and by the commanded thrust; None where it is not logged.
        turning_b: rad/s by which the gyroscope read more than the poses turned, (3,), body axes.
        spread: in m, rms of the places about their mean; a delay and a scale show only in motion.
    """

    start: float
    imu: Fit
    motors: Fit | None
    turning_b: Array
    spread: float


def windows(topics: Topics, parameters: Parameters, spans: Spans) -> list[Window]:
    """Return the residuals of a flight, window by window; empty where the log has no poses."""
    flight = motion_of(topics, parameters)
    return [] if flight is None else list(flight.windows(spans))


def motion_of(topics: Topics, parameters: Parameters) -> Motion | None:
    """Return the motion according to poses, IMU and motors; None without poses or IMU."""
    if not has(topics, "tracker_pose", *TRACKED, *TRACKED_ATTITUDE):
        return None
    return Motion(topics, parameters) if has(topics, "imu", *FORCE, *RATE) else None


class Motion:
    """The motion of one flight, by each of its witnesses.

    Attributes:
        times, places: of the poses, in s, (N,), and in m, (N, 3).
        time: of the IMU, in s, (M,).
        R_wb: attitudes by the poses at the times of the IMU, (M, 3, 3).
        felt: acceleration that the accelerometer felt, in m/s², (M, 3), world axes.
        pushed: the same as the commanded thrust makes it; None where it is not logged.
        rates: of the gyroscope, in rad/s, (M, 3).
    """

    def __init__(self, topics: Topics, parameters: Parameters) -> None:
        imu, poses = topics["imu"], topics["tracker_pose"]
        fresh = np.concatenate([[True], np.diff(poses.time) > 0.0])
        self.times = poses.time[fresh]
        self.places = poses.rows(TRACKED)[fresh].astype(np.float64)
        self._attitudes = poses.rows(TRACKED_ATTITUDE)[fresh].astype(np.float64)
        make_continuous(self._attitudes)
        self.time = imu.time
        turned = [np.interp(self.time, self.times, one) for one in self._attitudes.T]
        attitudes = np.stack(turned, axis=1)
        attitudes /= np.maximum(np.linalg.norm(attitudes, axis=1, keepdims=True), 1e-9)
        self.R_wb = matrices_of(attitudes)
        gravity = np.array([0.0, 0.0, GRAVITY])
        felt = imu.rows(FORCE).astype(np.float64)
        self.felt = np.einsum("nij,nj->ni", self.R_wb, felt) - gravity
        self.rates = imu.rows(RATE).astype(np.float64)
        self.pushed: Array | None = None
        mass = number(parameters, "model.mass", 0.0)
        if has(topics, "actuators", "thrust") and mass > 0.0:
            thrust = np.interp(
                self.time, topics["actuators"].time, topics["actuators"].values("thrust")
            )
            self.pushed = self.R_wb[:, :, 2] * (thrust / mass)[:, None] - gravity
        self._drag = number(parameters, "model.drag", 0.0) / mass if mass > 0.0 else 0.0

    def windows(self, spans: Spans) -> Iterator[Window]:
        usual = float(np.median(np.diff(self.time)))
        for start, end in spans:
            begins = np.arange(start, end - WINDOW + 1e-9, STEP)
            if len(begins) and end - WINDOW - begins[-1] > 0.25 * STEP:
                begins = np.append(begins, end - WINDOW)  # what began just before the landing
            for begin in begins:
                first, last = np.searchsorted(self.times, (begin, begin + WINDOW))
                i, j = np.searchsorted(self.time, (begin, begin + WINDOW))
                if last - first >= LEAST_POSES and (j - i) * usual >= LEAST_SHARE * WINDOW:
                    yield self._window(float(begin), slice(first, last), slice(i, j))

    def _window(self, start: float, poses: slice, samples: slice) -> Window:
        imu = self._fit(self.felt[samples], poses, samples, with_drag=False)
        motors = None
        if self.pushed is not None:
            motors = self._fit(self.pushed[samples], poses, samples, with_drag=True)
        return Window(
            start=start,
            imu=imu,
            motors=motors,
            turning_b=self._turning(poses, samples),
            spread=float(np.sqrt(self.places[poses].var(axis=0).sum())),
        )

    def _fit(self, acceleration: Array, poses: slice, samples: slice, *, with_drag: bool) -> Fit:
        time = self.time[samples]
        times = self.times[poses]
        velocity = integrated(time, acceleration)
        place = integrated(time, velocity)
        seen = self.places[poses]
        t = times - time[0]
        own = np.stack([np.ones(len(t)), t, t**2 / 2.0, t**3 / 6.0], axis=1)
        moved = _at(times, time, place)
        keep = np.ones(len(t), bool)
        for _ in range(2):  # the second time without outliers
            first = np.linalg.lstsq(own[keep], (seen - moved)[keep], rcond=None)[0]
            v = _at(times, time, velocity) + own[:, :3] @ first[1:]
            shared = [-_twice(t, v)] if with_drag else [-v, moved]
            q = np.linalg.qr(own[keep])[0]
            columns = [(one[keep] - q @ (q.T @ one[keep])).ravel() for one in shared]
            left = (seen - moved)[keep]
            target = (left - q @ (q.T @ left)).ravel()
            basis = np.stack(columns, axis=1)
            found = np.linalg.lstsq(basis, target, rcond=None)[0]
            known = sum(one * two for one, two in zip(shared, found, strict=True))
            rest = seen - moved - known
            own_found = np.linalg.lstsq(own[keep], rest[keep], rcond=None)[0]
            off = np.linalg.norm(rest - own @ own_found, axis=1)
            spread = 1.48 * float(np.median(off[keep]))
            keep = off <= OUTLYING * max(spread, 1e-6)
        rms = float(np.sqrt((off[keep] ** 2).mean() / 3.0))
        lacking, ending = (own_found[2] + at * own_found[3] for at in (0.5 * (t[0] + t[-1]), t[-1]))
        return Fit(
            acceleration_w=lacking,
            ending_w=ending,
            ending_b=self.R_wb[samples.stop - 1].T @ ending,
            delay=0.0 if with_drag else float(found[0]),
            scale=0.0 if with_drag else float(found[1]),
            drag=float(found[0]) - self._drag if with_drag else 0.0,
            rms=rms,
        )

    def _turning(self, poses: slice, samples: slice) -> Array:
        """Return how much faster (rad/s) the gyroscope turned than the poses, at the window's
        end: a line through the medians of its parts.
        """
        attitudes, times = self._attitudes[poses], self.times[poses]
        step = max(1, len(times) // 12)
        one, two = attitudes[:-step], attitudes[step:]
        lasted = (times[step:] - times[:-step])[:, None]
        middle = attitudes[step // 2 :][: len(one)]
        vectors_w = rotation_vectors_between(one, two)
        vectors_b = np.einsum("nji,nj->ni", matrices_of(middle), vectors_w)
        angle = _at(times, self.time[samples], integrated(self.time[samples], self.rates[samples]))
        excess = (angle[step:] - angle[:-step] - vectors_b) / lasted
        parts = np.array([np.median(part, axis=0) for part in np.array_split(excess, PARTS)])
        at = np.linspace(-1.0, 1.0, 2 * PARTS + 1)[1::2]
        line = parts.mean(axis=0) + (at @ parts) / (at @ at)
        found: Array = np.clip(line, parts.min(axis=0), parts.max(axis=0))  # a step is none
        return found


def integrated(time: Array, values: Array) -> Array:
    """Return the integral (N, 3) from the first sample on, by the trapezoidal rule."""
    steps = np.diff(time)[:, None] * 0.5 * (values[1:] + values[:-1])
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def _twice(time: Array, values: Array) -> Array:
    return integrated(time, integrated(time, values))


def _at(times: Array, time: Array, values: Array) -> Array:
    return np.stack([np.interp(times, time, one) for one in values.T], axis=1)
