"""Parameters as rcl_interfaces messages and back: values, lists of them, and descriptions.

Data for which ROS 2 has no field (unit, default, one-sided bounds, choices, steps in flight) travel
as JSON in `additional_constraints`, so that a ParameterDescription is restored exactly.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping

from quadrotor.errors import LinkError, WrongTypeError
from quadrotor.parameter_description import ParameterDescription, ParameterValue
from vehicle_link.messages import decode, encode, header, new, records, stamp_of
from vehicle_link.messages.records import Parameter, ParameterDescriptor
from vehicle_link.parameters.change import ParameterChange

NOT_SET, BOOL, INTEGER, DOUBLE, STRING = range(5)
ROS_TYPES = {"bool": BOOL, "int": INTEGER, "float": DOUBLE, "str": STRING}
CONSTRAINTS = ("unit", "default", "minimum", "maximum", "step", "choices", "flight_step")
"""Fields of a description for which ROS 2 has none."""
_INT64 = 2**63


def encode_change(change: ParameterChange) -> bytes:
    """Encode `parameter_changes`: quadlab_msgs/ParameterChange. Raises WrongTypeError."""
    return encode(
        new(
            "quadlab_msgs/ParameterChange",
            header=header(change.stamp_ns),
            name=change.name,
            old_value=to_value(change.old),
            new_value=to_value(change.new),
            requester=change.requester,
            revision=change.revision,
            instance=change.instance,
        )
    )


def decode_change(payload: bytes) -> ParameterChange:
    """Decode a quadlab_msgs/ParameterChange. Raises LinkError."""
    change = decode(payload, "quadlab_msgs/ParameterChange")
    try:
        old, value = from_value(change.old_value), from_value(change.new_value)
    except WrongTypeError as error:
        raise LinkError(f"{change.name}: {error}") from error
    return ParameterChange(
        stamp_of(change),
        str(change.name),
        old=old,
        new=value,
        requester=str(change.requester),
        revision=int(change.revision),
        instance=int(change.instance),
    )


def to_value(value: object) -> records.ParameterValue:
    """Encode as rcl_interfaces/ParameterValue. Raises WrongTypeError without a ROS scalar type."""
    if isinstance(value, bool):
        return new("rcl_interfaces/ParameterValue", type=BOOL, bool_value=value)
    if isinstance(value, int) and -_INT64 <= value < _INT64:
        return new("rcl_interfaces/ParameterValue", type=INTEGER, integer_value=value)
    if isinstance(value, float):
        return new("rcl_interfaces/ParameterValue", type=DOUBLE, double_value=value)
    if isinstance(value, str):
        return new("rcl_interfaces/ParameterValue", type=STRING, string_value=value)
    raise WrongTypeError(
        f"{value!r} is not a parameter value; a number, true, false or a text is allowed"
    )


def from_value(message: records.ParameterValue) -> ParameterValue:
    """Return the value of a ParameterValue. Raises WrongTypeError if it is an array or not set."""
    if message.type == BOOL:
        return bool(message.bool_value)
    if message.type == INTEGER:
        return int(message.integer_value)
    if message.type == DOUBLE:
        return float(message.double_value)
    if message.type == STRING:
        return str(message.string_value)
    kind = "not set" if message.type == NOT_SET else f"of array type {message.type}"
    raise WrongTypeError(f"a value {kind} was sent; a number, true, false or a text is allowed")


def to_parameters(values: Mapping[str, ParameterValue]) -> list[Parameter]:
    """Encode each value as an rcl_interfaces/Parameter. Raises WrongTypeError."""
    return [
        new("rcl_interfaces/Parameter", name=name, value=to_value(value))
        for name, value in values.items()
    ]


def from_parameters(messages: Iterable[Parameter]) -> dict[str, ParameterValue]:
    """Return values by name. Raises WrongTypeError, naming the parameter."""
    values = {}
    for message in messages:
        try:
            values[str(message.name)] = from_value(message.value)
        except WrongTypeError as error:
            raise WrongTypeError(f"{message.name}: {error}") from error
    return values


def to_descriptor(description: ParameterDescription) -> ParameterDescriptor:
    """Encode as rcl_interfaces/ParameterDescriptor; its range only where both bounds are given."""
    low, high = description.minimum, description.maximum
    ranges: dict[str, list[tuple[float, float, float]]] = {}
    if low is not None and high is not None and description.type in ("int", "float"):
        step = description.step or 0.0
        if description.type == "float":
            ranges["floating_point_range"] = [(low, high, step)]
        else:
            ranges["integer_range"] = [(math.ceil(low), math.floor(high), round(step))]
    constraints = {name: getattr(description, name) for name in CONSTRAINTS}
    return new(
        "rcl_interfaces/ParameterDescriptor",
        name=description.name,
        type=ROS_TYPES[description.type],
        description=description.description,
        additional_constraints=json.dumps(constraints, ensure_ascii=False),
        read_only=description.read_only,
        **ranges,
    )


def from_descriptor(message: ParameterDescriptor) -> ParameterDescription:
    """Decode a description. Raises LinkError when the descriptor is not one of quadlab's."""
    try:
        kind = {number: name for name, number in ROS_TYPES.items()}[int(message.type)]
        constraints = json.loads(message.additional_constraints)
        constraints["choices"] = tuple(constraints["choices"])
        return ParameterDescription(
            name=message.name,
            type=kind,
            description=message.description,
            read_only=bool(message.read_only),
            **{name: constraints[name] for name in CONSTRAINTS},
        )
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise LinkError(
            f"the description of {message.name!r} cannot be read ({error!r}); "
            "do both ends run the same version of quadlab?"
        ) from error
