"""The description of a parameter, and checks of values against it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from quadrotor.errors import OutOfBoundsError, WrongTypeError

ParameterValue = bool | int | float | str


@dataclass(frozen=True, slots=True)
class ParameterDescription:
    """The description of a parameter: all that a client needs to display and edit it."""

    name: str
    type: str  # "bool", "int", "float" or "str"
    default: ParameterValue
    description: str
    unit: str
    minimum: float | None
    maximum: float | None
    step: float | None
    read_only: bool
    choices: tuple[str, ...]
    flight_step: float | None = None  # largest change in flight


def coerce(description: ParameterDescription, value: object) -> ParameterValue:
    """Return `value` as the described type and within its bounds.

    Raises WrongTypeError or OutOfBoundsError.
    """
    name, kind = description.name, description.type
    if kind == "bool":
        if not isinstance(value, bool):
            raise _wrong_type(description, value, "true or false")
        return value
    if kind == "str":
        if not isinstance(value, str):
            raise _wrong_type(description, value, "text")
        if description.choices and value not in description.choices:
            raise OutOfBoundsError(
                f"{name} = {value!r} is not one of {', '.join(description.choices)}"
            )
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _wrong_type(description, value, "a number")
    if not math.isfinite(value):
        raise OutOfBoundsError(f"{name} = {value} is not a finite number; {_allowed(description)}")
    if kind == "int" and value != int(value):
        raise _wrong_type(description, value, "an integer")
    low, high = description.minimum, description.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        raise OutOfBoundsError(f"{name} = {value:g} is out of bounds; {_allowed(description)}")
    return int(value) if kind == "int" else float(value)


def parse_text(description: ParameterDescription, text: str) -> ParameterValue:
    """Return a value typed by a user (`--set name=value`, a text box), checked as in `coerce`."""
    if description.type == "bool":
        if text.lower() in ("true", "false"):
            return text.lower() == "true"
        raise _wrong_type(description, text, "true or false")
    if description.type == "str":
        return coerce(description, text)
    try:
        number = float(text)
    except ValueError:
        raise _wrong_type(description, text, "a number") from None
    return coerce(description, number)


def _wrong_type(description: ParameterDescription, value: object, expected: str) -> WrongTypeError:
    return WrongTypeError(
        f"{description.name} must be {expected}, not {value!r}; {_allowed(description)}"
    )


def _allowed(description: ParameterDescription) -> str:
    unit = f" {description.unit}" if description.unit else ""
    low, high = description.minimum, description.maximum
    if low is not None and high is not None:
        bounds = f"allowed {low:g} to {high:g}{unit}, "
    elif low is not None:
        bounds = f"allowed from {low:g}{unit}, "
    elif high is not None:
        bounds = f"allowed up to {high:g}{unit}, "
    else:
        bounds = f"allowed {', '.join(description.choices)}, " if description.choices else ""
    return f"{bounds}default {description.default}"
