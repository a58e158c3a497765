"""Descriptions of parameters in the form that a vehicle reports."""

from __future__ import annotations

from typing import Any

from quadrotor.parameter_description import ParameterDescription


def described(name: str, kind: str = "float", **changes: Any) -> ParameterDescription:
    """Return the description of a number from 0 to 20, or of another kind by `changes`."""
    fields: dict[str, Any] = {
        "default": 4.0,
        "description": "",
        "unit": "",
        "minimum": 0.0,
        "maximum": 20.0,
        "step": 0.1,
        "read_only": False,
        "choices": (),
    }
    return ParameterDescription(name=name, type=kind, **(fields | changes))
