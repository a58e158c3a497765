"""A step of a parameter in flight towards a value that is farther away than one step may go."""

from __future__ import annotations

import math

from quadrotor.parameter_description import ParameterValue


def step_towards(
    step: float | None, present: ParameterValue, value: ParameterValue
) -> ParameterValue:
    """Return the value, or the farthest value from the present one that one step reaches.

    Args:
        step: the longest step in flight; None if every value may be set at once.
    """
    if step is None:
        return value
    change = float(value) - float(present)
    return value if abs(change) <= step else float(present) + math.copysign(step, change)
