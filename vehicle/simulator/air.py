"""Effects of moving air on the vehicle: gusts, the rotors' drag and loss of thrust, the ground.

Records `p` are items of PLANT (vehicle.simulator.plant).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rigid_body import Motion, drag_torque, motion_of
from quadrotor.vectors import Vector, along, axes_of, to_body, vector

ROTOR_RADIUS, ROTOR_HEIGHT = 0.127, 0.15
"""Radius, and height of the rotors' plane over the body's origin, where the feet are folded, in m
(Sec. 2)."""

_SHAPED = 1.0 - math.sqrt(3.0)


@compiled(inner=True)
def blow(plant: Record, noise: npt.NDArray[np.float64], row: int, dt: float) -> None:
    """Advance the gusts by dt (s): Dryden's turbulence of a given deviation and time L/V.

    Along the steady wind (along x_W without one) the spectrum is of first order, across it and
    vertically of second order: MIL-F-8785C, 3.7.2.2, as shaping filters of white noise.

    Args:
        noise: standard normal numbers (rows, >= 3 columns).
    """
    p = plant[0]
    if p.gust > 0.0:
        fade = math.exp(-dt / p.gust_time)
        draw = p.gust * math.sqrt(1.0 - fade * fade)
        g = p.gusts
        g[0] = fade * g[0] + draw * noise[row, 0]
        for i in range(1, 3):
            g[2 + i] = fade * g[2 + i] + (1.0 - fade) * g[i]
            g[i] = fade * g[i] + math.sqrt(0.5) * draw * noise[row, i]
        across = math.sqrt(3.0) * g[1] + _SHAPED * g[3]
        up = math.sqrt(3.0) * g[2] + _SHAPED * g[4]
        wind = math.hypot(p.wind_w[0], p.wind_w[1])
        c, s = (p.wind_w[0] / wind, p.wind_w[1] / wind) if wind > 0.0 else (1.0, 0.0)
        p.air_w[0] = p.wind_w[0] + c * g[0] - s * across
        p.air_w[1] = p.wind_w[1] + s * g[0] + c * across
        p.air_w[2] = p.wind_w[2] + up


@compiled(inner=True)
def air_speed_b(p: Item, motion: Motion) -> Vector:
    """Return the vehicle's velocity (m/s) through the air, along its axes."""
    return to_body(axes_of(motion[2]), along(motion[1], -1.0, vector(p.air_w)))


@compiled(inner=True)
def drag_of_rotors(p: Item, motion: Motion) -> tuple[Vector, Vector]:
    """Return the force (N) and the torque (N m) of the rotors' drag, along body axes.

    The drag of blades that advance and retreat is linear in the air's velocity across the rotors:
    P. Martin, E. Salaun, "The true role of accelerometer feedback in quadrotor control", 2010. It
    acts in the rotors' plane, over the centre of mass, and so lifts the leading side, as flapping
    does: G. Hoffmann et al., "Quadrotor helicopter flight dynamics and control", 2007.
    """
    x, y, _ = air_speed_b(p, motion)
    force_b = -p.rotor_drag_b[0] * x, -p.rotor_drag_b[1] * y, 0.0
    return force_b, drag_torque(p.model.drag_lever, force_b)


@compiled(inner=True)
def inflow_gain(p: Item) -> float:
    """Return the thrust relative to that in air at rest.

    A climbing rotor has less thrust, as each blade meets the air at a smaller angle.
    """
    if p.inflow_loss <= 0.0:
        return 1.0
    climb = air_speed_b(p, motion_of(p.x))[2]
    gain: float = min(1.5, max(0.5, 1.0 - p.inflow_loss * climb))
    return gain


@compiled(inner=True)
def ground_gain(share: float, height: float) -> float:
    """Return the thrust relative to that far from the ground, at a height (m) of the body's origin.

    I. C. Cheeseman, W. E. Bennett, "The effect of the ground on a helicopter rotor in forward
    flight", 1955: 1 / (1 - (R / 4z)^2), here times `share`, with z of the rotors.
    """
    if share <= 0.0 or height > 1.0:
        return 1.0
    ratio = ROTOR_RADIUS / (4.0 * max(ROTOR_RADIUS, height + ROTOR_HEIGHT))
    return 1.0 / (1.0 - share * ratio * ratio)
