"""Values that a log carries: attached JSON, and parameters, as text or typed.

Whoever made the file wrote them, so whatever cannot be read is a ValueError, also what is nested
deeper than the interpreter's stack.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from typing import Any

from quadrotor.errors import LogFormatError, WrongTypeError
from quadrotor.parameters import ParameterValue
from vehicle_link.parameters.messages import from_value

LONGEST = 100_000
"""Characters of one parameter's value; the largest layout of beacons has a tenth of it."""


def json_value(data: bytes | str) -> Any:
    """Parse an attachment. Raises ValueError when it is no JSON."""
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deep") from None


def literal_value(text: str) -> Any:
    """Return the number, truth or text that `repr` wrote. Raise ValueError for anything else."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters are no parameter's value")
    try:
        return ast.literal_eval(text)
    except (SyntaxError, TypeError, MemoryError, RecursionError) as error:
        raise ValueError(str(error) or "it is nested too deep") from None


def parameters_of(attachment: bytes | None) -> dict[str, ParameterValue]:
    """Name → value at the start; a station's own begin with `station.`. Empty: not recorded."""
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
    """Return a value of a ParameterChange; older logs have it as Python's text.

    Raises LogFormatError.
    """
    try:
        found = literal_value(value) if isinstance(value, str) else from_value(value)
    except (ValueError, WrongTypeError) as error:
        raise LogFormatError(f"{value!r:.80} is no parameter value: {error}") from error
    if not isinstance(found, bool | int | float | str):
        raise LogFormatError(f"{value!r:.80} is no number, true, false or text")
    return found


def _plain(values: Any) -> dict[str, ParameterValue]:
    if not isinstance(values, Mapping):
        return {}
    return {str(k): v for k, v in values.items() if isinstance(v, bool | int | float | str)}
