"""Feasibility: the inverse dynamics are those of the rigid body, and refusals are true."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from control.trajectories.circle import Circle
from control.trajectories.feasibility import Extreme, examine, fits, refusal
from control.trajectories.figure_eight import FigureEight
from control.trajectories.flatness import wrench_of_reference
from control.trajectories.limits import QUANTITIES, Limits, with_margin
from control.trajectories.line import Hover, Line
from control.trajectories.minimum_snap import minimum_snap
from control.trajectories.trajectory import Trajectory, sample_many
from quadrotor.records import Record, new_reference
from quadrotor.rotations import quaternion_from_matrix
from quadrotor.vehicle_model import GRAVITY, VehicleModel, mixing_matrix
from tests.support.arrays import Array
from tests.support.dynamics import derivative

MODEL = VehicleModel().record()
J = MODEL["inertia_b"][0]


def random_reference(rng: np.random.Generator, size: float = 1.0) -> Record:
    r = new_reference()
    for name in ("position_w", "velocity_w", "acceleration_w", "jerk_w", "snap_w"):
        r[name] = size * rng.normal(size=3)
    r["yaw"], r["yaw_rate"], r["yaw_acceleration"] = (
        rng.uniform(-3, 3),
        *(size * rng.normal(size=2)),
    )
    return r


def asked(reference: Record) -> tuple[Array, Array, Array, Array]:
    axes, omega, omega_dot, wrench = wrench_of_reference(reference[0], MODEL[0])
    return np.array(axes).T, np.array(omega), np.array(omega_dot), np.array(wrench)


@pytest.mark.parametrize("size", [0.0, 1e-8, 1.0])
def test_the_wrench_at_the_attitude_gives_the_acceleration_and_the_angular_acceleration(
    rng: np.random.Generator, size: float
) -> None:
    for _ in range(30):
        r = random_reference(rng, size)
        R_wb, omega, omega_dot, wrench = asked(r)
        x = np.concatenate([r["position_w"][0], r["velocity_w"][0], np.empty(4), omega])
        x[6:10] = quaternion_from_matrix(R_wb)
        out = np.empty(13)
        derivative(x, wrench, np.zeros(3), float(MODEL["mass"][0]), J, out)
        np.testing.assert_allclose(out[3:6], r["acceleration_w"][0], atol=1e-12)
        np.testing.assert_allclose(out[10:13], omega_dot, atol=1e-11)


def test_the_attitude_has_the_yaw_asked_for(rng: np.random.Generator) -> None:
    for _ in range(30):
        r = random_reference(rng)
        R_wb = asked(r)[0]
        off = math.atan2(R_wb[1, 0], R_wb[0, 0]) - r["yaw"][0]
        assert math.cos(off) == pytest.approx(1.0, abs=1e-12)


def test_rates_are_the_derivatives_of_the_attitude_along_a_path() -> None:
    path = FigureEight((0, 0, 1), period=4.0, laps=2)
    h = 1e-5
    for t in (1.0, 3.3, 5.1, 8.8):
        before, here, after = (asked(sample_many(path, np.array([t + d]))) for d in (-h, 0, h))
        W = here[0].T @ (after[0] - before[0]) / (2 * h)
        np.testing.assert_allclose([W[2, 1], W[0, 2], W[1, 0]], here[1], atol=1e-7)
        np.testing.assert_allclose((after[1] - before[1]) / (2 * h), here[2], atol=1e-6)


def independent(path: Trajectory, step: float = 2e-3) -> tuple[Array, dict[str, Array]]:
    """Return time series of all quantities by numpy alone.

    The rates are differences, and the motors solve M f = u.
    """
    t = np.arange(0.0, path.duration + step, step)
    s = sample_many(path, t)
    mass = float(MODEL["mass"][0])
    force = mass * (s["acceleration_w"] + [0, 0, GRAVITY])
    z = force / np.linalg.norm(force, axis=1)[:, None]
    y_c = np.stack([-np.sin(s["yaw"]), np.cos(s["yaw"]), 0 * t], axis=1)
    x = np.cross(y_c, z)
    x /= np.linalg.norm(x, axis=1)[:, None]
    R = np.stack([x, np.cross(z, x), z], axis=2)
    W = np.swapaxes(R, 1, 2) @ np.gradient(R, t, axis=0)
    omega = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
    torque = J * np.gradient(omega, t, axis=0) + np.cross(omega, J * omega)
    wrench = np.column_stack([np.linalg.norm(force, axis=1), torque])
    M = mixing_matrix(float(MODEL["arm"][0]), float(MODEL["torque_ratio"][0]))
    thrusts = np.linalg.solve(M, wrench.T).T
    p = s["position_w"]
    return t, {
        "x": p[:, 0],
        "y": p[:, 1],
        "z": p[:, 2],
        "speed": np.linalg.norm(s["velocity_w"], axis=1),
        "acceleration": np.linalg.norm(s["acceleration_w"], axis=1),
        "yaw rate": np.abs(s["yaw_rate"]),
        "yaw acceleration": np.abs(s["yaw_acceleration"]),
        "tilt": np.degrees(np.arccos(z[:, 2])),
        "least motor thrust": thrusts.min(axis=1),
        "largest motor thrust": thrusts.max(axis=1),
        "body rate": np.linalg.norm(omega, axis=1),
        "yaw torque": np.abs(torque[:, 2]),
    }


PATHS: dict[str, Trajectory] = {
    "eight": FigureEight((0.3, 0, 1), period=4.0, laps=2, ramp=2.0),
    "short ramp": FigureEight((0, 0, 1), period=5.0, laps=2, ramp=0.7),
    "circle": Circle((0, 0, 1, 0.3), radius=1.5, period=5.0, laps=2, nose="tangent"),
    "line": Line((0, 0, 1, 0), (2, 1, 2, 2), speed=2.0, acceleration=4.0),
    "least snap": minimum_snap(
        np.array([[0, 0, 1, 0], [1, 0, 1.5, 1], [1, 1, 1, 0], [0, 0, 1, -1.0]]),
        np.array([0, 1.5, 3.0, 5.0]),
    ),
}


class OneByOne:
    """Trajectory that offers the protocol and no more."""

    def __init__(self, path: Trajectory) -> None:
        self.duration, self.sample = path.duration, path.sample


PATHS["plain"] = OneByOne(PATHS["eight"])


def breach_of(path: Trajectory, limits: Limits) -> Extreme:
    found = examine(path, MODEL, limits).breach
    assert found is not None
    return found


@pytest.mark.parametrize("name", PATHS)
def test_extremes_and_their_times_are_those_of_an_independent_computation(name: str) -> None:
    path = PATHS[name]
    t, series = independent(path)
    for e in examine(path, MODEL, Limits()).extremes:
        values = series[e.name]
        sign = QUANTITIES[e.index].sign
        worst = sign * (sign * values).max()
        size = max(np.abs(values).max(), 1e-2)
        assert e.value == pytest.approx(worst, abs=5e-3 * size), e.name
        at_its_time = np.interp(e.time, t, values)
        assert at_its_time == pytest.approx(worst, abs=1e-2 * size), e.name


LIMITED: dict[str, Callable[[float], Limits]] = {
    "x": lambda v: Limits(high_w=(v, math.inf, math.inf)),
    "z": lambda v: Limits(high_w=(math.inf, math.inf, v)),
    "speed": lambda v: Limits(speed=v),
    "acceleration": lambda v: Limits(acceleration=v),
    "yaw rate": lambda v: Limits(yaw_rate=v),
    "yaw acceleration": lambda v: Limits(yaw_acceleration=v),
    "tilt": lambda v: Limits(tilt=math.radians(v)),
    "least motor thrust": lambda v: Limits(thrust_low=v),
    "largest motor thrust": lambda v: Limits(thrust_high=v),
    "body rate": lambda v: Limits(body_rate=v),
    "yaw torque": lambda v: Limits(yaw_torque=v),
}


@pytest.mark.parametrize("path", ["eight", "short ramp", "least snap"])
@pytest.mark.parametrize("name", LIMITED)
def test_each_breach_is_refused_with_its_number_and_the_time_it_begins(
    name: str, path: str
) -> None:
    t, series = independent(PATHS[path])
    values = series[name]
    sign = -1.0 if name == "least motor thrust" else 1.0
    low, high = values[0] if sign > 0 else values.min(), values.max()
    limit = 0.4 * low + 0.6 * high if sign > 0 else 0.6 * values[0] + 0.4 * values.min()
    limits = LIMITED[name](limit)
    report = examine(PATHS[path], MODEL, limits)
    assert not report.feasible
    assert not fits(PATHS[path], MODEL, limits)
    broken = np.argmax(sign * values > sign * limit)
    assert report.breach is not None
    assert report.breach.name == name
    assert report.breach.first == pytest.approx(t[broken], abs=6e-3)
    assert report.breach.limit == pytest.approx(limit, rel=1e-6)
    text = refusal(report, report.breach, "the flight", "wait")
    assert text.startswith("the flight refused: ")
    assert f"from {report.breach.first:.2f} s on" in text
    assert "\n" not in text
    worst = sign * (sign * values).max()
    shown = f"{report.breach.value:.2f}" if name in "xz" else f"{report.breach.value:.3g}"
    assert shown in text
    assert report.breach.value == pytest.approx(worst, abs=5e-3 * np.abs(values).max())
    # With one per cent more room it may fly.
    roomy = worst + sign * 0.01 * np.abs(values).max()
    assert examine(PATHS[path], MODEL, LIMITED[name](roomy)).feasible


def test_breaches_are_reported_volume_first_and_causes_before_consequences() -> None:
    path = PATHS["eight"]
    everything = Limits(
        low_w=(-9, -9, -9), high_w=(9, 9, 1.1), acceleration=1.0, tilt=0.1, thrust_high=3.3
    )
    assert breach_of(path, everything).name == "z"
    without_walls = Limits(acceleration=1.0, tilt=0.1, thrust_high=3.3)
    assert breach_of(path, without_walls).name == "acceleration"
    assert breach_of(path, Limits(tilt=0.1, thrust_high=3.3)).name == "tilt"


def test_a_breach_in_laps_that_are_skipped_is_found_where_it_begins() -> None:
    # It climbs 5 m in 100 laps; only the first and the last metres are checked.
    path = Circle((0, 0, 1, 0), rise=0.05, laps=100, period=4.0, ramp=2.0)
    breach = breach_of(path, Limits(high_w=(9, 9, 3.0)))
    assert breach.name == "z"
    assert breach.first is not None
    at = sample_many(path, np.array([breach.first - 2e-3, breach.first + 2e-3]))
    assert at["position_w"][0, 2] < 3.0 < at["position_w"][1, 2]


def test_a_wall_is_named_with_the_way_out() -> None:
    limits = Limits((-1, -1, 0.5), (1, 1, 2))
    path = Line((0, 0, 1, 0), (1.5, 0, 1, 0), speed=1, acceleration=1)
    text = refusal(examine(path, MODEL, limits), breach_of(path, limits), "it")
    assert "x = 1.50 m is outside the flight volume" in text
    assert "allowed -1 to 1 m (behavior.volume_x_min, behavior.volume_x_max)" in text
    assert "0.50 m further towards -x" in text
    on_the_wall = Line((0, 0, 1, 0), (1, 0, 1, 0), speed=1, acceleration=1)
    assert examine(on_the_wall, MODEL, limits).feasible


def test_free_fall_and_what_is_not_a_number_are_refused() -> None:
    class Falls:
        duration = 2.0

        def sample(self, t: float, reference: Record) -> None:
            reference[...] = new_reference()
            reference["acceleration_w"][0, 2] = -GRAVITY if 0.5 < t < 1.0 else 0.0

    class Lost(Falls):
        def sample(self, t: float, reference: Record) -> None:
            reference[...] = new_reference()
            reference["position_w"][0, 0] = np.nan if t > 1.5 else 0.0

    breach = breach_of(Falls(), Limits(tilt=1.0))
    assert breach.name == "tilt"
    assert breach.first == pytest.approx(0.5, abs=2e-3)
    assert breach_of(Lost(), Limits(high_w=(9, 9, 9))).first == pytest.approx(1.5, 1e-2)


def test_what_has_no_end_cannot_be_examined() -> None:
    with pytest.raises(ValueError, match="without an end"):
        examine(Hover((0.0, 0.0, 1.0), 0.0), MODEL, Limits())


def test_the_margin_is_a_share_of_the_motors_range_at_both_ends() -> None:
    assert with_margin(0.3, 6.3, 0.1) == pytest.approx((0.9, 5.7))


def test_a_heavier_vehicle_needs_more_thrust_in_proportion() -> None:
    heavy = MODEL.copy()
    heavy["mass"] *= 1.5
    heavy["inertia_b"] *= 1.5
    a, b = (examine(PATHS["eight"], m, Limits()) for m in (MODEL, heavy))
    name = "largest motor thrust"
    assert b.of(name).value == pytest.approx(1.5 * a.of(name).value, rel=1e-9)
    assert b.of("tilt").value == pytest.approx(a.of("tilt").value, rel=1e-12)
