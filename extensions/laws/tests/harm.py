"""Harm in place of a law's answer, for tests of the rescue: of any law, from any moment on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from control.geometric_law import apply_wrench
from control.laws import Own, Records
from quadrotor.compiled import direct
from quadrotor.records import Array
from quadrotor.vehicle_model import GRAVITY

Way = Callable[[Array, float, float], None]
"""Changes a wrench (4,) (N, N m) in place, given the time (s) since the harm began and the weight
(N)."""


def _set(axis: int, value: float) -> Way:
    def change(u: Array, since: float, weight: float) -> None:
        u[axis] = value

    return change


def _add(axis: int, torque: Callable[[float], float]) -> Way:
    def change(u: Array, since: float, weight: float) -> None:
        u[axis] += torque(since)

    return change


def _lift(share: float) -> Way:
    def change(u: Array, since: float, weight: float) -> None:
        u[0] = share * weight

    return change


def _turned_torque(u: Array, since: float, weight: float) -> None:
    u[1:] *= -1.0


def _turned_thrust(u: Array, since: float, weight: float) -> None:
    u[0] = 2.0 * weight - u[0]


def _shaken(u: Array, since: float, weight: float) -> None:
    u[1:3] += 0.45 * np.sign(np.sin(2.0 * math.pi * np.array([2.0, 3.0]) * since))


def _held(u: Array, since: float, weight: float) -> None:
    """Keep the first answer; see `Harm`."""


BAD = {
    "NaN thrust": "which is not finite",
    "infinite torque": "which is not finite",
    "jolts": "its torque is",
    "no thrust": "its thrust is",
}
"""Harms that are out of bounds in their first tick, and part of the reason told."""
WAYS = {
    "NaN thrust": _set(0, math.nan),
    "infinite torque": _set(2, math.inf),
    "jolts": _add(1, lambda since: 2.0),
    "no thrust": _set(0, 0.0),
    "wrong sign of torque": _turned_torque,
    "wrong sign of thrust": _turned_thrust,
    "oscillates more and more": _add(
        1, lambda since: 0.02 * math.exp(2.0 * since) * math.sin(6.0 * math.pi * since)
    ),
    "shakes": _shaken,
    "leans": _add(1, lambda since: 0.45),
    "creeps": _add(2, lambda since: 0.1 * since),
    "spins": _add(3, lambda since: 0.3),
    "sinks": _lift(0.55),
    "climbs": _lift(1.45),
    "answers the same for ever": _held,
}
"""All harms. Most stay within the bounds of the wrench by a little, for as long as they can."""


class Harm:
    """Stands between the laws of extensions and the vehicle, in place of `direct`.

    Attributes:
        way: of WAYS; empty while a law answers what it computed.
    """

    def __init__(self) -> None:
        self.way = ""
        self._since = 0.0
        self._first: Array | None = None

    def direct(self, step: Callable[..., None], *arguments: object) -> Any:
        """Return a function that calls a law's step, and then does harm."""
        code = direct(step, *arguments)

        def spoiled(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
            code(own, records, flown, airborne, dt)
            if self.way:
                self._spoil(records, dt)

        return spoiled

    def _spoil(self, records: Records, dt: float) -> None:
        *_, model, actuators = records
        wrench = actuators["wrench"]
        if self._first is None:
            self._first = wrench.copy()
        if self.way == "answers the same for ever":
            wrench[:] = self._first
        WAYS[self.way](wrench[0], self._since, GRAVITY * model["mass"].item())
        self._since += dt
        wanted = wrench.copy()
        apply_wrench(wanted, model, actuators)
        if not np.isfinite(wanted).all():
            wrench[:] = wanted  # the allocation has none that is not finite
