"""Values in a log: attached JSON, and parameters, as text or typed.

A log may be damaged or hostile, so everything that cannot be read is a ValueError, including
nesting deeper than the interpreter's stack.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from typing import Any

from quadrotor.errors import LogFormatError, WrongTypeError
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.messages import from_value

PARAMETERS = "parameters.json"
"""Name of the attachment with the parameters at the start of a run."""
LONGEST = 100_000
"""Longest value of a parameter, in characters; the largest layout of beacons has a tenth of it."""


def json_value(data: bytes | str) -> Any:
    """Parse an attachment. Raises ValueError when it is not JSON."""
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def literal_value(text: str) -> Any:
    """Return the number, boolean or text that `repr` wrote. Raises ValueError for anything else."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters are no parameter's value")
    try:
        return ast.literal_eval(text)
    except (SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(str(error) or "it is nested too deep") from None


def parameters_of(attachment: bytes | None) -> dict[str, ParameterValue]:
    """Return name → value at the start of the log; a station's names begin with `station.`. Empty
    if not recorded.
    """
    try:
        read = json_value(attachment or b"{}")
    except ValueError:
        return {}
    if not isinstance(read, Mapping):
        return {}
    if "vehicle" not in read and "station" not in read:
        return _plain(read)
    values = _plain(read.get("vehicle"))
    for name, value in _plain(read.get("station")).items():
        values[name if name.startswith("station.") else f"station.{name}"] = value
    return values


def logged_value(value: Any) -> ParameterValue:
    """Return a value of a ParameterChange; older logs store it as Python's repr.

    Raises LogFormatError.
    """
    try:
        found = literal_value(value) if isinstance(value, str) else from_value(value)
    except (ValueError, WrongTypeError) as error:
        raise LogFormatError(f"{value!r:.80} is not a parameter value: {error}") from error
    if not isinstance(found, bool | int | float | str):
        raise LogFormatError(f"{value!r:.80} is not a number, true, false or text")
    return found


def _plain(values: object) -> dict[str, ParameterValue]:
    if not isinstance(values, Mapping):
        return {}
    return {str(k): v for k, v in values.items() if isinstance(v, bool | int | float | str)}
