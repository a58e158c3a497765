"""Loads that are not in the middle: a cable-suspended load, and products of inertia.

Records `p` are items of PLANT (vehicle.simulator.plant).
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.rigid_body import Motion
from quadrotor.vectors import Vector, cross, dot
from quadrotor.vehicle_model import GRAVITY

CABLE_FREQUENCY = 150.0
"""Natural frequency, in rad/s, of the load on its elastic cable, which hangs 0.4 mm longer."""
CABLE_DAMPING = 0.3
"""Damping ratio of the same."""


@compiled(inner=True)
def pull_of_load(p: Item, motion: Motion) -> Vector:
    """Return the force (N, world axes) of the cable on the body: none while it is slack."""
    position_w, velocity_w, _, _ = motion
    load = p.load
    x, y, z = load[0] - position_w[0], load[1] - position_w[1], load[2] - position_w[2]
    distance = math.sqrt(x * x + y * y + z * z)
    stretch = distance - p.load_length
    if stretch <= 0.0:
        return 0.0, 0.0, 0.0
    x, y, z = x / distance, y / distance, z / distance
    rate = dot((x, y, z), (load[3], load[4], load[5])) - dot((x, y, z), velocity_w)
    stiffness = p.load_mass * CABLE_FREQUENCY * CABLE_FREQUENCY
    damping = 2.0 * p.load_mass * CABLE_FREQUENCY * CABLE_DAMPING
    tension = max(0.0, stiffness * stretch + damping * rate)
    return tension * x, tension * y, tension * z


@compiled(inner=True)
def swing(p: Item, motion: Motion, dt: float) -> Vector:
    """Advance the load by dt (s) and return the force (N, world axes) of its cable on the body.

    The load is a point that the floor stops. It follows the semi-implicit Euler scheme.
    """
    pull_w = pull_of_load(p, motion)
    load = p.load
    for i in range(3):
        load[3 + i] -= pull_w[i] / p.load_mass * dt
    load[5] -= GRAVITY * dt
    for i in range(3):
        load[i] += load[3 + i] * dt
    if load[2] < 0.0:
        load[2] = load[3] = load[4] = load[5] = 0.0
    return pull_w


@compiled(inner=True)
def spin_of_products(p: Item, omega: Vector, turn: Vector) -> Vector:
    """Return the angular acceleration (rad/s^2) that the products of inertia add.

    With the whole inertia J and its diagonal D: J^-1 (t - w x J w) - D^-1 (t - w x D w), the
    difference of two rigid bodies' equations (Euler) under the same torque t.

    Args:
        turn: torque over the diagonal of the inertia, rad/s^2.
    """
    D, (xy, xz, yz) = p.model.inertia_b, (p.products_b[0], p.products_b[1], p.products_b[2])
    x, y, z = omega
    plain = D[0] * x, D[1] * y, D[2] * z
    whole = plain[0] + xy * y + xz * z, plain[1] + xy * x + yz * z, plain[2] + xz * x + yz * y
    a, b = cross(omega, plain), cross(omega, whole)
    t = D[0] * turn[0] - b[0], D[1] * turn[1] - b[1], D[2] * turn[2] - b[2]
    inverse = p.full_inverse_b
    return (
        inverse[0, 0] * t[0] + inverse[0, 1] * t[1] + inverse[0, 2] * t[2] - turn[0] + a[0] / D[0],
        inverse[1, 0] * t[0] + inverse[1, 1] * t[1] + inverse[1, 2] * t[2] - turn[1] + a[1] / D[1],
        inverse[2, 0] * t[0] + inverse[2, 1] * t[1] + inverse[2, 2] * t[2] - turn[2] + a[2] / D[2],
    )
