"""The options of the board in use as parameters of the vehicle: `board.NAME`."""

from __future__ import annotations

from copy import copy
from typing import Any

from quadrotor.parameters import Parameters, parameters_of

FIRMWARE = "board.firmware."
"""Prefix of parameters that a board alone knows, once it has been checked."""
_offered = Parameters()


def offered() -> Parameters:
    """Return the options of the board that was offered last, with their values."""
    return _offered.model_copy(deep=True)


def offer(options: Parameters | None, *, live: bool) -> None:
    """Make the options of a board part of the trees of parameters made from now on.

    Args:
        options: None for a board without any.
        live: whether the board applies a change at once; otherwise they can only be read.
    """
    global _offered  # noqa: PLW0603 - like the parameters of plugins, one for each process
    shown = options or Parameters()
    _offered = shown if live else _fixed(shown)


def _fixed(options: Parameters) -> Parameters:
    """Return options that a store shows and does not change."""
    fields: dict[str, Any] = {}
    for name, field in type(options).model_fields.items():
        kept, extra = copy(field), field.json_schema_extra
        kept.json_schema_extra = (extra if isinstance(extra, dict) else {}) | {"read_only": True}
        fields[name] = (field.annotation, kept)
    made = parameters_of(Parameters, "FixedOptions", fields)()
    for name in fields:
        setattr(made, name, getattr(options, name))
    return made
