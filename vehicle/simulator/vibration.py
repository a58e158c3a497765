"""The vibration of the rotors as measured by the inertial sensors.

Each rotor is slightly and differently out of balance, which gives a force that turns with it. Each
passing blade, two per turn, gives an impulse along z. The rest is broadband. At hover the three
together have the requested deviation; all grow with the square of the rotor's speed, as forces of
rotation do.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.constants import THRUST_PER_TURN
from quadrotor.records import Item
from quadrotor.rigid_body import rotor_thrust
from quadrotor.vectors import Vector

Array = npt.NDArray[np.float64]

IMBALANCE = (0.94, 0.56, 1.31, 0.75)
"""Relative imbalance of each rotor; assumed."""
PITCH = (1.0, 1.017, 0.988, 1.009)
"""Speed of each rotor relative to the others' at the same thrust: no two propellers are alike, so
their lines beat instead of adding up. Assumed."""
LINES = math.sqrt(2.0 * 0.7 / sum(one * one for one in IMBALANCE))
"""Amplitude of a rotor's lines over the deviation: they hold 70 % of the variance, assumed between
the 94 and 96 % of two PX4 flights and none of a third, above 15 Hz at 200 Hz."""
BROADBAND = math.sqrt(0.3)
"""Deviation of the broadband rest."""


@compiled(inner=True)
def turn_rotors(p: Item, duration: float) -> None:
    """Advance the angles of a PLANT record's rotors by `duration` (s)."""
    for i in range(4):
        thrust = rotor_thrust(p.rotor_speeds[i], p.model.motor_slope, p.model.motor_offset)
        turns = p.rotor_turns[i] + PITCH[i] * math.sqrt(thrust / THRUST_PER_TURN) * duration
        p.rotor_turns[i] = turns - math.floor(turns)


@compiled(inner=True)
def lines(p: Item, imbalance: Array, hover_thrust: float) -> tuple[Vector, float]:
    """Return the rotors' lines along body axes, and the broadband share, over the hover deviation.

    Args:
        imbalance: of each rotor, relative, (4,).
        hover_thrust: N, of one rotor.
    """
    x = y = z = total = 0.0
    for i in range(4):
        thrust = rotor_thrust(p.rotor_speeds[i], p.model.motor_slope, p.model.motor_offset)
        share = thrust / hover_thrust
        angle = 2.0 * math.pi * p.rotor_turns[i]
        amplitude = LINES * imbalance[i] * share
        x += amplitude * math.cos(angle)
        y += amplitude * math.sin(angle)
        z += amplitude * math.cos(2.0 * angle)
        total += 0.25 * share
    return (x, y, z), BROADBAND * total
