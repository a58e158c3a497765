"""A bias or an integral that stays at its bound is a flag, with a line that names the bound."""

from __future__ import annotations

from typing import Any

import pytest

from tests.vehicle.estimators.test_stack_estimators import EstimatorLab
from vehicle.modes import Flag


def at_bound(lab: EstimatorLab) -> bool:
    return Flag.AT_BOUND in Flag(int(lab.stack.status["flags"][0]))


@pytest.mark.parametrize("estimator", ["complementary", "error_state"])
def test_a_bias_that_its_bound_holds_for_a_second_is_told_until_it_is_free(estimator: str) -> None:
    lab = EstimatorLab(estimator=estimator)
    lab.change({"imu.accelerometer_bias_x": 0.4})  # the sensor has none
    lab.hovering()
    lab.wait(8.0)
    assert not at_bound(lab)
    lab.set(accelerometer_bias_limit=0.1)
    lab.wait(0.8)
    assert not at_bound(lab)
    lab.wait(1.0)
    assert at_bound(lab)
    bound = "estimation.accelerometer_bias_limit = 0.1"
    assert len([text for text in lab.texts() if f"{bound} has held" in text]) == 1
    lab.set(accelerometer_bias_limit=1.0)
    lab.wait(2.0)
    assert not at_bound(lab)
    assert "estimation.accelerometer_bias_limit holds no longer" in lab.texts()


@pytest.mark.parametrize(
    "settings",
    [{"control.limits.position_integral_max": 1e-4}, {"mass.mass_max": 1.1, "mass.gain": 5.0}],
)
def test_bounds_of_the_law_and_of_the_mass_are_told_in_flight(settings: dict[str, Any]) -> None:
    lab = EstimatorLab()
    lab.change(settings)
    lab.hovering()
    lab.wait(6.0)
    assert at_bound(lab)
    bounded = next(name for name in settings if name.endswith("_max"))
    assert [text for text in lab.texts() if f"{bounded} = {settings[bounded]:g} has held" in text]


def test_a_tilt_that_its_limit_holds_is_told_until_the_law_no_longer_flies() -> None:
    lab = EstimatorLab()
    lab.change({"control.limits.tilt_max": 5.0})
    lab.hovering()
    lab.change({"simulator.push_x": 1.5})  # 6.7° would stand against it
    lab.wait(0.8)
    assert not at_bound(lab)
    lab.wait(0.7)
    assert at_bound(lab)
    assert [text for text in lab.texts() if "control.limits.tilt_max = 5 has held" in text]
    lab.start("near_hovering")  # the board holds the angles, and the law's values are old
    lab.wait(0.1)
    assert not at_bound(lab)
