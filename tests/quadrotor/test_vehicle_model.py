"""Mixing, motor law and limits of the paper's vehicle."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from quadrotor.vehicle_model import (
    MODEL,
    VehicleModel,
    mixing_matrix,
    reference_of_thrust,
    thrust_of_reference,
    thrusts_of_wrench,
    wrench_of_thrusts,
)

ARM, RATIO = 0.25, 0.0174
SLOPE, OFFSET = 0.0126403, 14.267


def test_the_mixing_matrix_is_the_one_of_eq_1() -> None:
    M = mixing_matrix(2.0, 3.0)
    assert M.tolist() == [[1, 1, 1, 1], [0, 2, 0, -2], [-2, 0, 2, 0], [3, -3, 3, -3]]


def test_its_rows_are_orthogonal_so_the_inverse_is_closed() -> None:
    M = mixing_matrix(ARM, RATIO)
    np.testing.assert_allclose(M @ M.T, np.diag([4, 2 * ARM**2, 2 * ARM**2, 4 * RATIO**2]))


def test_thrusts_and_wrench_are_the_matrix_and_its_inverse() -> None:
    rng = np.random.default_rng(3)
    print("seed 3")
    M = mixing_matrix(ARM, RATIO)
    for _ in range(50):
        thrusts = rng.uniform(0, 6, size=4)
        wrench = wrench_of_thrusts((*thrusts,), ARM, RATIO)
        np.testing.assert_allclose(wrench, M @ thrusts, atol=1e-14)
        np.testing.assert_allclose(thrusts_of_wrench(wrench, ARM, RATIO), thrusts, atol=1e-12)


@pytest.mark.parametrize(
    ("motor", "torques"),
    [(0, (0, -1, 1)), (1, (1, 0, -1)), (2, (0, 1, 1)), (3, (-1, 0, -1))],
    ids=["front", "left", "rear", "right"],
)
def test_each_motor_turns_the_body_its_own_way(motor: int, torques: tuple[int, int, int]) -> None:
    # x forward, y left, z up: more thrust on the left rolls right (+x), in front pitches up (-y).
    wrench = wrench_of_thrusts(np.eye(4)[motor], ARM, RATIO)
    assert np.sign(wrench[1:]).tolist() == list(torques)


def test_the_motor_law_meets_the_two_printed_forces() -> None:
    assert thrust_of_reference(30.0, SLOPE, OFFSET) == pytest.approx(0.3131, abs=5e-5)
    assert thrust_of_reference(180.0, SLOPE, OFFSET) == pytest.approx(6.03, abs=5e-3)


def test_hover_is_at_127_counts() -> None:
    assert reference_of_thrust(1.308 * 9.81 / 4, SLOPE, OFFSET) == pytest.approx(127.4, abs=0.1)


def test_the_motor_law_and_its_inverse_undo_each_other() -> None:
    for thrust in (0.05, 0.3131, 3.21, 6.03):
        count = reference_of_thrust(thrust, SLOPE, OFFSET)
        assert thrust_of_reference(count, SLOPE, OFFSET) == pytest.approx(thrust)


@pytest.mark.parametrize("thrust", [0.0, -1.0])
def test_no_thrust_is_no_negative_reference(thrust: float) -> None:
    assert reference_of_thrust(thrust, SLOPE, OFFSET) == 0.0
    assert thrust_of_reference(-100.0, SLOPE, OFFSET) == 0.0


def test_the_record_holds_what_the_parameters_say() -> None:
    record = VehicleModel(mass=1.5, inertia_zz=0.03).record()
    assert record.dtype == MODEL
    assert record.shape == (1,)
    assert record["mass"][0] == 1.5
    assert record["inertia_b"][0].tolist() == [0.0154, 0.0154, 0.03]
    assert record["thrust_min"][0] == pytest.approx(0.3131, abs=5e-5)
    assert record["thrust_max"][0] == pytest.approx(6.03, abs=5e-3)


@pytest.mark.parametrize("mass", [0.0, -1.0, 100.0, float("nan"), "heavy"])
def test_a_mass_that_cannot_be_is_refused(mass: float | str) -> None:
    with pytest.raises(ValidationError):
        VehicleModel.model_validate({"mass": mass})


def test_without_an_exponent_the_voltage_changes_nothing() -> None:
    model = VehicleModel()
    assert model.record(12.0).tobytes() == model.record().tobytes()


def test_a_low_battery_asks_for_more_counts_and_allows_less_thrust() -> None:
    model = VehicleModel(battery_exponent=1.0)
    full, low = model.record()[0], model.record(0.9 * 15.2)[0]
    assert low["motor_slope"] == pytest.approx(0.9 * full["motor_slope"])
    assert low["thrust_max"] == pytest.approx(0.81 * full["thrust_max"])
    count = reference_of_thrust(3.21, low["motor_slope"], OFFSET)
    # The computed counts turn the rotor, at 0.9 of the speed for a count, at the requested speed.
    assert 0.9 * (count + OFFSET) == pytest.approx(np.sqrt(3.21) / SLOPE, rel=1e-5)


@pytest.mark.parametrize(("voltage", "share"), [(0.0, 0.5), (1e9, 1.5)])
def test_a_broken_voltage_reading_is_clamped(voltage: float, share: float) -> None:
    assert VehicleModel(battery_exponent=1.0).battery_gain(voltage) == pytest.approx(share)
