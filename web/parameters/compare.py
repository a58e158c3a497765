"""Comparison of a set of values with the present ones: the changes, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from quadrotor.errors import ParameterError, ReadOnlyError
from quadrotor.json_object import JsonObject
from quadrotor.parameter_description import ParameterValue
from web.parameters.replica import PageParameters
from web.parameters.stepwise import steps_between

MOST_SHOWN = 200  # characters of a value that is refused


def compare(replica: PageParameters, values: Mapping[str, Any]) -> JsonObject:
    """Return the differences as `lines`, in the order of the tree, and `same`, the number of equal
    parameters.

    Each line has name, unit, now, new, `reason` ("" or why it is refused) and `steps`, the number
    of changes it needs in flight. Raises LinkError before anything was read.
    """
    replica.check({})
    order = {d.name: k for k, d in enumerate(replica.descriptions())}
    lines, same = [], 0
    for name in sorted(values, key=lambda n: order.get(n, len(order))):
        new, now, description = values[name], replica.value(name), replica.description(name)
        reason, steps = "", 1
        try:
            [checked] = replica.check({name: new}).values()
            if checked == now:
                same += 1
                continue
            if description is not None and description.read_only:
                raise ReadOnlyError(f"set at the start only, by --set {name}={new}")
            new, steps = checked, steps_between(replica, {name: checked})
        except ParameterError as error:
            reason, new = str(error), _shown(new)
        lines.append(
            {
                "name": name,
                "unit": description.unit if description else "",
                "now": now,
                "new": new,
                "reason": reason,
                "steps": steps,
            }
        )
    return {"lines": lines, "same": same}


def differing(replica: PageParameters, values: Mapping[str, ParameterValue]) -> int:
    """Return the number of these values that differ from the vehicle's."""
    return sum(replica.value(name) != value for name, value in values.items())


def _shown(value: object) -> object:
    if isinstance(value, bool | int) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return str(value)[:MOST_SHOWN]  # text, date, list or nan
