"""Eq. 4, and the rules that keep the direction of the force defined."""

from __future__ import annotations

import numpy as np
import pytest

from control.parameters import ControlParameters, control_record
from control.position_law import desired_force, force_rates, limit_force
from quadrotor.records import REFERENCE, Record, new_reference, new_state
from quadrotor.rotations import quaternion_to_matrix, rotation_exp
from quadrotor.vectors import axes_of
from tests.support.arrays import Array

MASS = 1.308
G = 9.81


def random_records(rng: np.random.Generator) -> tuple[Record, Record]:
    state, reference = new_state(), new_reference()
    for name in ("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"):
        reference[name] = rng.normal(size=3)
    state["position_w"], state["velocity_w"] = rng.normal(size=3), rng.normal(size=3)
    q = np.array([1.0, 0.0, 0.0, 0.0]) + 0.2 * rng.normal(size=4)
    state["quaternion_wb"] = q / np.linalg.norm(q)
    state["angular_velocity_b"] = rng.normal(size=3)
    return state, reference


def errors_of(
    state: Record, reference: Record
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    e_p = reference["position_w"][0] - state["position_w"][0]
    e_v = reference["velocity_w"][0] - state["velocity_w"][0]
    return tuple(e_p), tuple(e_v)


def force_of(state: Record, reference: Record, integral: Array, gains: Record) -> Array:
    acceleration = tuple(reference["acceleration_w"][0])
    errors = errors_of(state, reference)
    return np.array(desired_force(*errors, tuple(integral), acceleration, gains[0], MASS))


def test_the_force_is_eq_4_with_three_different_gains(rng: np.random.Generator) -> None:
    state, reference = random_records(rng)
    gains = control_record(ControlParameters())
    integral = rng.normal(size=3)
    out = force_of(state, reference, integral, gains)
    kp, kv, ki = np.array([4, 4, 8]), np.array([3.5, 3.5, 5]), np.array([1, 1, 2])
    e_p = (reference["position_w"] - state["position_w"])[0]
    e_v = (reference["velocity_w"] - state["velocity_w"])[0]
    expected = MASS * (
        reference["acceleration_w"][0] + kp * e_p + ki * integral + kv * e_v + [0, 0, G]
    )
    np.testing.assert_allclose(out, expected, rtol=1e-12)


def test_at_rest_on_the_reference_the_force_is_the_weight() -> None:
    gains = control_record(ControlParameters())
    out = force_of(new_state(), new_reference(), np.zeros(3), gains)
    np.testing.assert_allclose(out, [0, 0, MASS * G], rtol=1e-14)


def test_a_limited_force_points_up_within_the_tilt_and_keeps_its_heading(
    rng: np.random.Generator,
) -> None:
    weight = MASS * G
    for _ in range(500):
        tilt = rng.uniform(0.1, 1.2)
        force = rng.normal(size=3) * rng.choice([1e-9, 1.0, 10.0, 100.0])
        before = force
        cut, limited = limit_force(tuple(before), weight, np.tan(tilt))
        force = np.array(cut)
        assert force[2] >= 0.3 * weight * (1 - 1e-12)
        assert np.hypot(force[0], force[1]) <= force[2] * np.tan(tilt) * (1 + 1e-12)
        assert limited == (not np.array_equal(before, force))
        assert before[0] * force[1] == pytest.approx(before[1] * force[0], abs=1e-9)
        assert before[0] * force[0] >= 0.0


def test_a_force_within_the_limits_is_untouched() -> None:
    assert limit_force((1.0, -2.0, 12.0), MASS * G, 1.0) == ((1.0, -2.0, 12.0), False)


def test_free_fall_is_turned_into_a_small_upward_force() -> None:
    force, limited = limit_force((0.0, 0.0, 0.0), MASS * G, 1.0)
    assert limited
    np.testing.assert_allclose(force, [0, 0, 0.3 * MASS * G])


def test_exact_rates_are_the_derivatives_of_the_force_along_the_model(
    rng: np.random.Generator,
) -> None:
    gains = control_record(ControlParameters())
    state, reference = random_records(rng)
    integral = rng.normal(size=3)

    def force_at(h: float) -> Array:
        """Return f_d after h seconds of eq. 2 with u_1 = f_d . z_B, by Euler-midpoint steps."""
        n = 400
        s, r, total = state.copy(), reference.copy(), integral.copy()
        p, v = s["position_w"][0].copy(), s["velocity_w"][0].copy()
        w = s["angular_velocity_b"][0]
        R0 = quaternion_to_matrix(s["quaternion_wb"][0])
        d = {k: reference[k][0] for k in (REFERENCE.names or ())[:5]}

        def evaluate(t: float, p: Array, v: Array, total: Array) -> tuple[Array, Array, Array]:
            r["position_w"] = (
                d["position_w"]
                + d["velocity_w"] * t
                + d["acceleration_w"] * t**2 / 2
                + d["jerk_w"] * t**3 / 6
                + d["snap_w"] * t**4 / 24
            )
            r["velocity_w"] = (
                d["velocity_w"]
                + d["acceleration_w"] * t
                + d["jerk_w"] * t**2 / 2
                + d["snap_w"] * t**3 / 6
            )
            r["acceleration_w"] = d["acceleration_w"] + d["jerk_w"] * t + d["snap_w"] * t**2 / 2
            s["position_w"], s["velocity_w"] = p, v
            out = force_of(s, r, total, gains)
            z = R0 @ rotation_exp(w * t)[:, 2]
            return out, (out @ z) * z / MASS - [0, 0, G], r["position_w"][0] - p

        dt = h / n
        for k in range(n):
            _, a, e = evaluate(k * dt, p, v, total)
            pm, vm, tm = p + v * dt / 2, v + a * dt / 2, total + e * dt / 2
            _, a, e = evaluate((k + 0.5) * dt, pm, vm, tm)
            p, v, total = p + vm * dt, v + a * dt, total + e * dt
        return evaluate(h, p, v, total)[0]

    h = 1e-3
    f_minus, f_0, f_plus = force_at(-h), force_at(0.0), force_at(h)
    e_p, e_v = errors_of(state, reference)
    axes = axes_of(tuple(state["quaternion_wb"][0]))
    omega_b = tuple(state["angular_velocity_b"][0])
    a, jerk, snap = (tuple(reference[f"{name}_w"][0]) for name in ("acceleration", "jerk", "snap"))
    first, other = force_rates(e_p, e_v, (a, jerk, snap), gains[0], MASS, axes, omega_b, tuple(f_0))
    np.testing.assert_allclose(first, (f_plus - f_minus) / (2 * h), rtol=2e-4, atol=2e-4)
    second = (f_plus - 2 * f_0 + f_minus) / h**2
    np.testing.assert_allclose(other, second, rtol=5e-3, atol=5e-2)
