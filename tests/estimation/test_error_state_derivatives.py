"""Every Jacobian of the error-state filter against finite differences of the true motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimation.error_state.memory import BEARINGS, MARKER, NOISES, POSE, new_memory
from estimation.error_state.motion import move, spread
from estimation.error_state.rows import linearize
from estimation.error_state.update import displace, reset
from estimation.error_state_parameters import ErrorStateParameters
from estimation.parameters import EstimationParameters, noise_record
from quadrotor.records import Array

UP = np.array([0.0, 0.0, 9.81])
NOISE = noise_record(
    EstimationParameters(
        error_state=ErrorStateParameters(marker_x=0.05, marker_y=-0.03, marker_z=0.1)
    )
)
BEACONS = np.array([[1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1], [1.0, -1.0, 0.1]])


def nominal(rng: np.random.Generator) -> Array:
    q = np.roll(Rotation.from_rotvec(rng.normal(0, 0.8, 3)).as_quat(), 1)
    low = [rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 2)]
    return np.concatenate([low, rng.normal(0, 1, 3), q, rng.normal(0, 0.05, 6)])


def rotation(x: Array) -> Rotation:
    return Rotation.from_quat(np.roll(x[6:10], -1))


def moved(x: Array, error: Array) -> Array:
    """Return x with a true state `error` away, by scipy: the defined convention."""
    out = x.copy()
    out[:3] += error[:3]
    out[3:6] += error[6:9]
    out[6:10] = np.roll((Rotation.from_rotvec(error[3:6]) * rotation(x)).as_quat(), 1)
    out[10:] += error[9:]
    return out


def apart(x: Array, y: Array) -> Array:
    """Return the error (15,) of estimate x when y is true."""
    turn = (rotation(y) * rotation(x).inv()).as_rotvec()
    return np.concatenate([y[:3] - x[:3], turn, y[3:6] - x[3:6], y[10:] - x[10:]])


def columns(function: Any, h: float = 1e-5) -> Array:
    return np.stack([(function(h * e) - function(-h * e)) / (2 * h) for e in np.eye(15)], axis=1)


def test_displace_is_the_stated_convention(rng: np.random.Generator) -> None:
    for size in (0.0, 1e-8, 0.3):
        x, error, out = nominal(rng), size * rng.normal(size=15), np.empty(16)
        displace(x, error, out)
        np.testing.assert_allclose(apart(x, out), error, atol=1e-12)
        np.testing.assert_allclose(apart(moved(x, error), out), 0.0, atol=1e-12)


def test_transition_of_the_covariance_is_that_of_the_motion(rng: np.random.Generator) -> None:
    silent = NOISE.copy()
    for name in ("accelerometer_noise", "gyroscope_noise"):
        silent[name] = 0.0
    for name in ("accelerometer_bias_walk", "gyroscope_bias_walk"):
        silent[name] = 0.0
    for _ in range(5):
        x, dt = nominal(rng), 1e-3
        force, rate = UP + rng.normal(0, 3, 3), rng.normal(0, 1, 3)

        def after(error: Array, x=x, force=force, rate=rate, dt=dt) -> Array:  # type: ignore[no-untyped-def]
            y = moved(x, error)
            move(y, tuple(force), tuple(force), tuple(rate), dt)
            return y

        reference = after(np.zeros(15))
        F = columns(lambda e, after=after, reference=reference: apart(reference, after(e)))
        root = rng.normal(size=(15, 15))
        P = root @ root.T
        wanted = F @ P @ F.T
        spread(P, x, tuple(force), silent[0], np.ones(NOISES), dt)
        np.testing.assert_allclose(P, wanted, atol=20.0 * dt * dt * np.abs(wanted).max())
        np.testing.assert_allclose(P, P.T, atol=1e-12)


def test_noise_grows_with_time_alone(rng: np.random.Generator) -> None:
    P, x = np.zeros((15, 15)), nominal(rng)
    spread(P, x, (0.0, 0.0, 9.81), NOISE[0], np.ones(NOISES), 0.002)
    for block, name in (
        (3, "gyroscope_noise"),
        (6, "accelerometer_noise"),
        (9, "gyroscope_bias_walk"),
        (12, "accelerometer_bias_walk"),
    ):
        expected = 0.002 * float(NOISE[name][0]) ** 2
        np.testing.assert_allclose(np.diag(P)[block : block + 3], expected, rtol=1e-12)


@pytest.mark.parametrize("kind", [BEARINGS, POSE, MARKER])
def test_rows_are_minus_the_derivative_of_the_residuals(
    kind: int, rng: np.random.Generator
) -> None:
    """h error = residual: moving the state by the error removes the residual."""
    for _ in range(10):
        m, x = new_memory(), nominal(rng)
        item = m[0]
        item["event_kind"][0], item["event_beacons"][0] = kind, 4
        item["event_sigma"][0] = 0.026
        if kind == BEARINGS:
            away = rotation(x).inv().apply(BEACONS - x[:3])
            item["event_data"][0, :4, :3] = BEACONS
            item["event_data"][0, :4, 3:] = away / np.linalg.norm(away, axis=1)[:, None]
        elif kind == MARKER:
            item["event_data"][0, 0, :3] = x[:3] + rotation(x).apply([0.05, -0.03, 0.1])
        else:
            item["event_data"][0, 0, :3], item["event_data"][0, 1, :4] = x[:3], x[6:10]
        count = 2 * linearize(m[0], 0, x, NOISE[0])
        rows = m["row"][0, :count].copy()
        np.testing.assert_allclose(m["rest"][0, :count], 0.0, atol=1e-12)

        def rest(error: Array, m=m, x=x, count=count) -> Array:  # type: ignore[no-untyped-def]
            linearize(m[0], 0, moved(x, error), NOISE[0])
            return np.array(m["rest"][0, :count])

        # Tangent axes turn with the direction; at zero residual that has no effect.
        J = columns(rest)
        np.testing.assert_allclose(J[:, :6], -rows, atol=1e-7)
        np.testing.assert_allclose(J[:, 6:], 0.0, atol=1e-12)


def test_a_bearing_residual_is_the_angle_over_the_whole_sphere(rng: np.random.Generator) -> None:
    for degrees in (1e-6, 1.0, 60.0, 120.0, 179.0):
        m, x = new_memory(), nominal(rng)
        d = rotation(x).inv().apply(BEACONS[0] - x[:3])
        d /= np.linalg.norm(d)
        axis = np.cross(d, rng.normal(size=3))
        axis *= math.radians(degrees) / np.linalg.norm(axis)
        m["event_kind"][0, 0], m["event_beacons"][0, 0], m["event_sigma"][0, 0] = BEARINGS, 1, 0.02
        m["event_data"][0, 0, 0] = [*BEACONS[0], *Rotation.from_rotvec(axis).apply(d)]
        linearize(m[0], 0, x, NOISE[0])
        length = math.hypot(*m["rest"][0, :2])
        assert length == pytest.approx(math.radians(degrees), rel=1e-6, abs=1e-12)


def test_reset_is_the_derivative_of_the_error_left(rng: np.random.Generator) -> None:
    phi = 0.05 * rng.normal(size=3)

    def left(error: Array) -> Array:
        out = error.copy()
        turn = Rotation.from_rotvec(phi + error[3:6]) * Rotation.from_rotvec(phi).inv()
        out[3:6] = turn.as_rotvec()
        return out

    J = columns(left)
    root = rng.normal(size=(15, 15))
    P = root @ root.T
    wanted = J @ P @ J.T
    reset(P, phi)
    np.testing.assert_allclose(P, wanted, atol=float(phi @ phi) * np.abs(wanted).max())
    np.testing.assert_allclose(P, P.T, atol=1e-12)
