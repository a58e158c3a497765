"""Uniform scaling to the motors' limits."""

from __future__ import annotations

import numpy as np
import pytest

from control.allocation import allocate
from quadrotor.records import Record
from quadrotor.vehicle_model import VehicleModel, mixing_matrix
from tests.support.arrays import Array

MODEL = VehicleModel().record()
LOW, HIGH = float(MODEL["thrust_min"][0]), float(MODEL["thrust_max"][0])
M = mixing_matrix(0.25, 0.0174)


def run(wrench: Array, model: Record = MODEL) -> tuple[float, Array]:
    force, x, y, z = map(float, wrench)
    thrusts, scaling = allocate((force, x, y, z), model[0])
    return scaling, np.array(thrusts)


def gravity(model: Record) -> Array:
    return np.array([float(model["mass"][0]) * 9.81, 0.0, 0.0, 0.0])


def heavy(mass: float) -> Record:
    model = MODEL.copy()
    model["mass"] = mass  # beyond what VehicleModel allows
    return model


def random_wrench(rng: np.random.Generator) -> Array:
    return rng.normal(size=4) * [15.0, 1.0, 1.0, 0.2] + [12.8, 0, 0, 0]


def test_a_feasible_wrench_is_given_exactly(rng: np.random.Generator) -> None:
    for _ in range(200):
        wrench = M @ rng.uniform(LOW + 1e-9, HIGH - 1e-9, size=4)
        scaling, thrusts = run(wrench)
        assert scaling == 1.0
        np.testing.assert_allclose(M @ thrusts, wrench, atol=1e-12)


def test_hover_has_nothing_to_scale() -> None:
    scaling, thrusts = run(gravity(MODEL))
    assert scaling == 1.0
    np.testing.assert_allclose(thrusts, 1.308 * 9.81 / 4)


def test_thrusts_are_feasible_and_the_scaling_is_the_largest(rng: np.random.Generator) -> None:
    scaled = 0
    for _ in range(1000):
        wrench = random_wrench(rng)
        scaling, thrusts = run(wrench)
        assert thrusts.min() >= LOW
        assert thrusts.max() <= HIGH
        assert 0.0 <= scaling <= 1.0
        if scaling < 1.0:
            scaled += 1
            f_g, f_r = (
                np.linalg.solve(M, gravity(MODEL)),
                np.linalg.solve(M, wrench - gravity(MODEL)),
            )
            more = f_g + (scaling + 1e-6) * f_r
            assert more.min() < LOW or more.max() > HIGH
    assert 100 < scaled < 1000


def test_the_direction_of_what_exceeds_gravity_is_kept(rng: np.random.Generator) -> None:
    for _ in range(300):
        wrench = random_wrench(rng)
        scaling, thrusts = run(wrench)
        given, wanted = M @ thrusts - gravity(MODEL), wrench - gravity(MODEL)
        np.testing.assert_allclose(given, scaling * wanted, atol=1e-9)


@pytest.mark.parametrize("mass", [2.6, 4.0, 0.1])
def test_an_infeasible_gravity_is_clipped_first_and_the_rest_still_fits(
    mass: float, rng: np.random.Generator
) -> None:
    model = heavy(mass)
    bound = HIGH if mass > 1 else LOW
    scaling, thrusts = run(gravity(model), model)
    np.testing.assert_allclose(thrusts, bound)
    assert scaling == 0.0
    for _ in range(200):
        scaling, thrusts = run(random_wrench(rng), model)
        assert 0.0 <= scaling <= 1.0
        assert thrusts.min() >= LOW
        assert thrusts.max() <= HIGH
    # A feasible wrench needs no scaling, for a heavy vehicle either.
    wrench = M @ rng.uniform(LOW + 0.1, HIGH - 0.1, size=4)
    scaling, thrusts = run(wrench, model)
    assert scaling == 1.0
    np.testing.assert_allclose(M @ thrusts, wrench, atol=1e-12)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", range(4))
def test_what_is_not_a_number_becomes_hover_thrust(bad: float, where: int) -> None:
    wrench = gravity(MODEL)
    wrench[where] = bad
    scaling, thrusts = run(wrench)
    assert scaling == 0.0
    np.testing.assert_allclose(thrusts, 1.308 * 9.81 / 4)
