"""The cost of gusts, by which limits are wider."""

from __future__ import annotations

import math

import pytest

from console.evaluation.world import PEAK, World, gusts_of
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.presets import preset_values

LIMITS = {"position_rms_m": 0.005, "position_max_m": 0.010, "yaw_rms_deg": 0.4}


def test_without_gusts_or_on_a_real_vehicle_no_limit_changes() -> None:
    for truth in ({}, dict(SimulatorParameters()), {"gust": 0.0, "mass": 1.3, "drag": 0.3}):
        world = gusts_of(truth)
        assert world.widened(LIMITS) == LIMITS
        assert world.metrics() == {}


def test_gusts_displace_by_their_drag_over_the_stiffness_of_the_position() -> None:
    truth = dict(SimulatorParameters()) | preset_values("rough")
    world = gusts_of(truth)
    # N rms along both axes, over the mass, over 4 1/s²; a simulated hover had 0.0383 m.
    assert world.displacement == pytest.approx(
        0.3 * math.hypot(0.42, 0.52) / truth["mass"] / 4.0, rel=1e-12
    )
    assert world.displacement == pytest.approx(0.0383, abs=2e-4)
    assert world.lasts == 1.5


def test_limits_are_wider_by_what_gusts_cost_and_those_of_other_figures_are_not() -> None:
    world = World(displacement=0.02)
    assert world.widened(LIMITS) == pytest.approx(
        {"position_rms_m": 0.025, "position_max_m": 0.010 + PEAK * 0.02, "yaw_rms_deg": 0.4}
    )
    assert world.widened({"mean_error_share": 0.003}) == {"mean_error_share": 0.003}
    assert World(0.02, 2.0).widened({"within_1_percent_s": 3.0, **LIMITS}) == pytest.approx(
        {
            "within_1_percent_s": 5.0,
            "position_rms_m": 0.005 + 1.5 * 0.02,  # sqrt(2 s/8 s) = 0.5, two standard deviations
            "position_max_m": 0.010 + PEAK * 0.02,
            "yaw_rms_deg": 0.4,
        }
    )
    assert world.metrics() == {"gusts_alone_m": 0.02}
