"""The work of the C++ twin, and no more, compiled from our own functions: laws, rotors, body.

The flight of `extensions.batches` also has a ground, rotors that drag, a hanging load, a centre of
mass, an inertia with products, and figures of the flight. What these cost, and what the compilers
differ by, are two things.
"""

from __future__ import annotations

import math

from extensions.batches.loop import copy_state
from extensions.batches.onboard import steer
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rigid_body import (
    gyroscopic_ratios,
    motion_of,
    motor_share,
    rk4,
    rotor_thrust,
    store_motion,
)
from quadrotor.vectors import Vector, along, axes_of, scale, store, times, to_body, vector
from quadrotor.vehicle_model import Four, wrench_of_thrusts


@compiled(inner=True)
def approach(speeds: Four, target: Four, share: float) -> Four:
    """Return the rotor speeds (counts) after that share of the way to their references."""
    return (
        speeds[0] + share * (target[0] - speeds[0]),
        speeds[1] + share * (target[1] - speeds[1]),
        speeds[2] + share * (target[2] - speeds[2]),
        speeds[3] + share * (target[3] - speeds[3]),
    )


@compiled(inner=True)
def driven(p: Item, speeds: Four, inverse_mass: float, inverse: Vector) -> tuple[float, Vector]:
    """Return thrust over mass (m/s^2), and torque over inertia, at these rotor speeds (counts)."""
    m, e, g = p.model, p.thrust_efficiency * p.battery_share * p.air_share, p.motor_gain
    a, b = m.motor_slope, m.motor_offset
    thrusts = (
        g[0] * rotor_thrust(speeds[0], a, b),
        g[1] * rotor_thrust(speeds[1], a, b),
        g[2] * rotor_thrust(speeds[2], a, b),
        g[3] * rotor_thrust(speeds[3], a, b),
    )
    thrust, x, y, z = wrench_of_thrusts(thrusts, m.arm, m.torque_ratio)
    return e * inverse_mass * thrust, times((e * x, e * y, e * z), inverse)


@compiled(inner=True)
def move(p: Item, target: Four, steps: int, dt: float, share: float) -> None:
    """Integrate rotors and body over `steps` of dt (s), as plant.hpp does."""
    m, s, drag = p.model, p.rotor_speeds, p.drag
    inverse_mass = 1.0 / m.mass
    J = m.inertia_b[0], m.inertia_b[1], m.inertia_b[2]
    inverse = 1.0 / J[0], 1.0 / J[1], 1.0 / J[2]
    ratios = gyroscopic_ratios(J, inverse)
    half_share = share / (1.0 + math.sqrt(1.0 - share))
    pull_w = along(vector(p.disturbance_w), drag, vector(p.air_w))
    motion = motion_of(p.x)
    speeds = s[0], s[1], s[2], s[3]
    start = driven(p, speeds, inverse_mass, inverse)
    for _ in range(steps):
        middle = driven(p, approach(speeds, target, half_share), inverse_mass, inverse)
        speeds = approach(speeds, target, share)
        end = driven(p, speeds, inverse_mass, inverse)
        motion = rk4(
            motion,
            (start[0], middle[0], end[0]),
            scale(inverse_mass, pull_w),
            drag * inverse_mass,
            (start[1], middle[1], end[1]),
            ratios,
            dt=dt,
        )
        start = end
    store_motion(motion, p.x)
    s[0], s[1], s[2], s[3] = speeds
    x, y, z = to_body(axes_of(motion[2]), along(pull_w, -drag, motion[1]))
    store((x * inverse_mass, y * inverse_mass, z * inverse_mass + start[0]), p.specific_force_b)


@compiled
def fly_true_state(
    settings: Record, plant: Record, onboard: Record, ticks: int, period: float, substeps: int
) -> float:
    """Fly a closed loop on the true state, in place; return the rms position error, m."""
    s, p, v = settings[0], plant[0], onboard[0]
    dt = period / substeps
    share = motor_share(p.model.motor_time_constant, dt)
    airborne = ticks > 0  # a plain True would be compiled as another type
    squares = 0.0
    for k in range(ticks):
        copy_state(p.x, v.state)
        steer(v, s, k * period, airborne, period)
        for i in range(3):
            e = v.reference.position_w[i] - p.x[i]
            squares += e * e
        r = v.actuators.motor_references
        move(p, (r[0], r[1], r[2], r[3]), substeps, dt, share)
    return math.sqrt(squares / ticks)
