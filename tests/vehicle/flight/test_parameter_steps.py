"""A gain changes by at most its step in flight, and freely within its bounds on the ground."""

from __future__ import annotations

import itertools

import pytest

from control.presets import PRESETS, preset
from quadrotor.errors import RefusedError
from quadrotor.parameters import Parameters, ParameterStore, parameter
from tests.support.lab import Lab
from vehicle.flight.configuration import check_steps
from vehicle.parameters import new_parameters

KP = "control.position.kp_xy"


@pytest.fixture(scope="module")
def hovering() -> Lab:
    flight = Lab().ready()
    flight.change({KP: 12.0})
    flight.change({KP: 4.0})  # any step on the ground
    return flight.hovering(settling=0.0)


def test_a_larger_step_in_flight_is_refused_with_what_is_allowed(hovering: Lab) -> None:
    before, revision = hovering.stack.store.values(), hovering.stack.store.revision
    with pytest.raises(RefusedError, match=rf"{KP} = 12 .* 0 to 8 1/s² at once; .* 2 steps"):
        hovering.change({KP: 12.0, "control.position.kp_z": 8.1})
    assert hovering.stack.store.values() == before
    assert hovering.stack.store.revision == revision


def test_the_same_way_goes_in_steps(hovering: Lab) -> None:
    for value in (8.0, 12.0, 8.0, 4.0):
        hovering.change({KP: value})
        assert hovering.parameter(KP) == value


def test_parameters_without_a_step_move_freely_in_flight(hovering: Lab) -> None:
    hovering.change({"behavior.fly_to_speed": 5.0})
    assert hovering.parameter("behavior.fly_to_speed") == 5.0


@pytest.mark.parametrize(("one", "other"), list(itertools.permutations(PRESETS, 2)))
def test_any_named_gain_set_follows_any_other_at_once_in_flight(one: str, other: str) -> None:
    parameters = new_parameters()
    parameters.control = preset(one)
    wanted = {f"control.{k}": v for k, v in ParameterStore(preset(other)).values().items()}
    check_steps(ParameterStore(parameters), wanted)


def test_what_acts_on_the_motors_at_once_has_a_step_within_its_range() -> None:
    steps = {d.name: d for d in ParameterStore(new_parameters()).descriptions() if d.flight_step}
    assert {"model.mass", "model.motor_slope", "imu.accelerometer_scale", KP} <= steps.keys()
    for d in steps.values():
        assert d.minimum is not None
        assert d.maximum is not None
        assert 0.0 < (d.flight_step or 0.0) <= (d.maximum - d.minimum) / 2.0, d.name


def test_only_floats_can_be_limited() -> None:
    class Counted(Parameters):
        laps: int = parameter(3, description="number of laps", flight_step=1.0)

    with pytest.raises(TypeError, match="laps: only a float"):
        ParameterStore(Counted())
