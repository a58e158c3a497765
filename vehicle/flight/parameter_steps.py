"""The limits on how far a parameter may move at once in flight.

A gain or a mass acts on the motors in the next tick, so that a slip of the hand is a jolt. What
is limited says so in its description; the page goes further in several changes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from quadrotor.errors import RefusedError
from quadrotor.parameters import ParameterStore, ParameterValue

ROUNDING = 1e-9
"""Of a step, by which values that a page computed may exceed it."""


def check_steps(store: ParameterStore, values: Mapping[str, ParameterValue]) -> None:
    """Check the steps of a change in flight; `values` as `store.check` gave them.

    Raises RefusedError that names the first that moves too far, and how far it may.
    """
    for name, value in values.items():
        description, present = store.description(name), store.get(name)
        step = description.flight_step
        if step is None or abs(float(value) - float(present)) <= step * (1.0 + ROUNDING):
            continue
        unit = f" {description.unit}" if description.unit else ""
        low, high = float(present) - step, float(present) + step
        if description.minimum is not None:
            low = max(low, description.minimum)
        if description.maximum is not None:
            high = min(high, description.maximum)
        steps = math.ceil(abs(float(value) - float(present)) / step * (1.0 - ROUNDING))
        raise RefusedError(
            f"{name} = {value:g} is too far from {present:g} in flight: {low:g} to {high:g}{unit} "
            f"at once; go there in {steps} steps, or land"
        )
