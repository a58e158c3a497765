"""Parameters as ROS messages: values and descriptions are converted back exactly."""

from __future__ import annotations

import math

import pytest

from quadrotor.errors import LinkError, WrongTypeError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.vehicle_model import VehicleModel
from vehicle_link.messages import decode, encode, new
from vehicle_link.parameters.messages import (
    from_descriptor,
    from_parameters,
    from_value,
    to_descriptor,
    to_parameters,
    to_value,
)

VALUES: dict[str, ParameterValue] = {
    "a": True,
    "b": False,
    "c": -(2**63),
    "d": 0.1,
    "e": "",
    "f": "grün",
    "g": math.inf,
}

DESCRIPTIONS = [
    *ParameterStore(VehicleModel()).descriptions(),
    ParameterDescription("i", "int", 3, "count", "", -5.0, 7.0, 2.0, False, ()),
    ParameterDescription("x", "float", 0.1, "one-sided", "m/s²", 0.0, None, None, False, ()),
    ParameterDescription("n", "float", -1.5, "free", "", None, None, 1e-7, True, ()),
    ParameterDescription("s", "str", "eight", "shape", "", None, None, None, False, ("eight", "o")),
    ParameterDescription("g", "float", 4.0, "", "", 0.0, 20.0, 0.1, False, (), 4.0),
    ParameterDescription("f", "bool", False, "switch", "", None, None, None, True, ()),
]


def test_values_come_back_with_their_type() -> None:
    back = from_parameters(to_parameters(VALUES))
    assert back == VALUES
    assert [type(v) for v in back.values()] == [type(v) for v in VALUES.values()]


def test_not_a_number_travels() -> None:
    assert math.isnan(from_value(to_value(math.nan)))  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [None, [1.0], 2**63])
def test_a_value_ros_has_no_scalar_for_is_refused(value: object) -> None:
    with pytest.raises(WrongTypeError, match="is not a parameter value"):
        to_value(value)


def test_an_array_or_unset_value_is_refused_with_its_name() -> None:
    array = new("rcl_interfaces/Parameter", name="gain", value={"type": 8})
    with pytest.raises(WrongTypeError, match=r"gain: a value of array type 8"):
        from_parameters([array])
    with pytest.raises(WrongTypeError, match=r"gain: a value not set"):
        from_parameters([new("rcl_interfaces/Parameter", name="gain")])


@pytest.mark.parametrize("description", DESCRIPTIONS, ids=lambda d: d.name)
def test_descriptions_come_back_exactly(description: ParameterDescription) -> None:
    payload = encode(to_descriptor(description))
    back = from_descriptor(decode(payload, "rcl_interfaces/ParameterDescriptor"))
    assert back == description
    assert type(back.default) is type(description.default)


def test_ros_tools_see_the_range() -> None:
    by_name = {d.name: to_descriptor(d) for d in DESCRIPTIONS}
    (mass,) = by_name["mass"].floating_point_range
    assert (mass.from_value, mass.to_value, mass.step) == (0.02, 2.4, 0.001)
    (count,) = by_name["i"].integer_range
    assert (count.from_value, count.to_value, count.step) == (-5, 7, 2)
    assert by_name["x"].floating_point_range == []
    assert by_name["n"].read_only


@pytest.mark.parametrize("constraints", ["", "[]", "{}", "no json"])
def test_a_foreign_descriptor_is_a_link_error(constraints: str) -> None:
    message = new(
        "rcl_interfaces/ParameterDescriptor",
        name="foreign",
        type=3,
        additional_constraints=constraints,
    )
    with pytest.raises(LinkError, match="description of 'foreign' cannot be read"):
        from_descriptor(message)
