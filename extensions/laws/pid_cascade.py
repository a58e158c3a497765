"""A cascade of P and PID loops with the structure of PX4's multicopter controllers.

PX4-Autopilot v1.15, PositionControl.cpp, AttitudeControl.cpp (D. Brescianini, M. Hehn, R. D'Andrea,
"Nonlinear quadrocopter attitude control", 2013) and RateControl.cpp:

    velocity      v_d = v_r + P_p e_p
    acceleration  a_d = a_r + P_v (v_d - v) + I_v
    attitude      q_d along a_d + g z_W with the yaw, of which the yaw part is reduced
    rates         omega_d = 2 P_q sgn(q_e0) q_e + yaw rate about z_W
    turn          nu = P_w (omega_d - omega) + I_w - D_w omega'

PX4 scales torques by the vehicle; here they are J nu. Departs from print: limits, allocation and
anti-wind-up are those of the paper's law; as the shadow of another law the integrals follow what
that one commands, so that taking over changes nothing at once.
"""

from __future__ import annotations

import math

import numpy as np

from control.geometric_law import wind
from control.laws import CompiledLaw, Own, Records, settings_type
from control.position_law import limit_force
from extensions.laws.desired import FOLLOWING, desired_axes, finish, flown_acceleration, follow
from extensions.laws.parameters import PidCascadeParameters
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import (
    Axes,
    Quaternion,
    Vector,
    add,
    axes_of,
    cross,
    dot,
    multiply,
    normalized,
    quaternion,
    scale,
    subtract,
    times,
    vector,
)
from quadrotor.vehicle_model import GRAVITY

YAW_WEIGHT = 0.4
"""MC_YAW_WEIGHT."""
VELOCITY_INTEGRAL_MAX = 4.0
"""m/s^2, largest acceleration of the integral, each axis."""
RATE_INTEGRAL_MAX = 8.0
"""rad/s^2, the same of the turn."""
SETTINGS = settings_type(PidCascadeParameters)
MEMORY = np.dtype(
    [
        ("running", "i8"),
        ("velocity_integral_w", "f8", 3),  # m/s^2
        ("rate_integral_b", "f8", 3),  # rad/s^2
        ("omega_before_b", "f8", 3),  # rad/s
        ("turn_b", "f8", 3),  # rad/s^2, measured, low passed
        ("desired_attitude", "f8", (3, 3)),
    ],
    align=True,
)


@compiled(inner=True)
def quaternion_of(axes: Axes) -> Quaternion:
    """Return the unit quaternion of a rotation, by its largest component."""
    (a, b, c), (d, e, f), (g, h, i) = axes  # columns
    trace = a + e + i
    if trace > 0.0:
        q = (1.0 + trace, f - h, g - c, b - d)
    elif a > e and a > i:
        q = (f - h, 1.0 + a - e - i, b + d, g + c)
    elif e > i:
        q = (g - c, b + d, 1.0 - a + e - i, f + h)
    else:
        q = (b - d, g + c, f + h, 1.0 - a - e + i)
    return normalized(q)


@compiled(inner=True)
def conjugate(q: Quaternion) -> Quaternion:
    """Return the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@compiled(inner=True)
def canonical(q: Quaternion) -> Quaternion:
    """Return q or -q, whose scalar part is not negative."""
    return (-q[0], -q[1], -q[2], -q[3]) if q[0] < 0.0 else q


@compiled(inner=True)
def attitude_rates(q: Quaternion, axes: Axes, desired: Axes) -> Vector:
    """Return 2 q_e, rad for small errors: tilt first, yaw by YAW_WEIGHT of its error."""
    q_d = quaternion_of(desired)
    z, z_d = axes[2], desired[2]
    # From the present to the desired direction of the thrust, by the shortest way.
    c, n = dot(z, z_d), cross(z, z_d)
    reduced = q_d
    if c > -1.0 + 1e-6:
        reduced = multiply(normalized((1.0 + c, n[0], n[1], n[2])), q)
    mix = canonical(multiply(conjugate(reduced), q_d))
    w, k = min(1.0, max(-1.0, mix[0])), min(1.0, max(-1.0, mix[3]))
    turned = math.cos(YAW_WEIGHT * math.acos(w)), 0.0, 0.0, math.sin(YAW_WEIGHT * math.asin(k))
    e = canonical(multiply(conjugate(q), multiply(reduced, turned)))
    return 2.0 * e[1], 2.0 * e[2], 2.0 * e[3]


@compiled(inner=True)
def desired_rates(s: Item, q: Quaternion, axes: Axes, desired: Axes, yaw_rate: float) -> Vector:
    """Return omega_d (rad/s, body axes), with the yaw rate (rad/s) about z_W fed forward."""
    P_q = s.attitude_p_xy, s.attitude_p_xy, s.attitude_p_z / YAW_WEIGHT
    up_b = axes[0][2], axes[1][2], axes[2][2]
    return add(times(P_q, attitude_rates(q, axes, desired)), scale(yaw_rate, up_b))


@compiled(inner=True)
def differentiate(m: Item, cutoff: float, omega_b: Vector, dt: float) -> None:
    """Measure the angular acceleration behind a low pass (rad/s)."""
    if m.running == 0:
        m.running = 1
        for i in range(3):
            m.omega_before_b[i] = omega_b[i]
    keep = -math.expm1(-cutoff * dt)
    for i in range(3):
        m.turn_b[i] += keep * ((omega_b[i] - m.omega_before_b[i]) / dt - m.turn_b[i])
        m.omega_before_b[i] = omega_b[i]


@compiled(inner=True)
def fly_one(
    m: Item,
    s: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    flown: bool,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one tick; see `control.laws`."""
    mass, weight, J = model.mass, model.mass * GRAVITY, vector(model.inertia_b)
    q, omega_b = quaternion(state.quaternion_wb), vector(state.angular_velocity_b)
    axes = axes_of(q)
    differentiate(m, s.rate_cutoff, omega_b, dt)

    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    P_p = s.position_p_xy, s.position_p_xy, s.position_p_z
    P_v = s.velocity_p_xy, s.velocity_p_xy, s.velocity_p_z
    velocity_d = add(vector(reference.velocity_w), times(P_p, e_p))
    e_v = subtract(velocity_d, vector(state.velocity_w))
    without = add(vector(reference.acceleration_w), times(P_v, e_v))
    a = add(without, vector(m.velocity_integral_w))
    wanted = mass * a[0], mass * a[1], mass * (a[2] + GRAVITY)
    force, limited = limit_force(wanted, weight, gains.tan_tilt_max)

    desired = desired_axes(m.desired_attitude, force, reference.yaw, weight)
    omega_d = desired_rates(s, q, axes, desired, reference.yaw_rate)
    e_w = subtract(omega_d, omega_b)
    P_w = s.rate_p_xy, s.rate_p_xy, s.rate_p_z
    nu = subtract(times(P_w, e_w), times((s.rate_d, s.rate_d, 0.0), vector(m.turn_b)))
    if airborne and not flown:
        one, share = (1.0, 1.0, 1.0), min(1.0, dt / FOLLOWING)
        pushed = flown_acceleration(actuators, axes, mass)
        follow(m.velocity_integral_w, pushed, without, one, share)
        u = actuators.wrench
        turn = u[1] / J[0], u[2] / J[1], u[3] / J[2]
        follow(m.rate_integral_b, turn, nu, one, share)
    torque = times(J, add(nu, vector(m.rate_integral_b)))
    scaling = finish(dot(force, axes[2]), torque, gains.yaw_torque_max, model, actuators)
    if flown and airborne and scaling == 1.0 and not limited:
        I_v = s.velocity_i_xy, s.velocity_i_xy, s.velocity_i_z
        I_w = s.rate_i_xy, s.rate_i_xy, s.rate_i_z
        wind(m.velocity_integral_w, times(I_v, e_v), dt, VELOCITY_INTEGRAL_MAX)
        wind(m.rate_integral_b, times(I_w, e_w), dt, RATE_INTEGRAL_MAX)


@compiled(pointer=True)
def step(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Compute one tick; see `control.laws`."""
    memory, settings = own
    state, reference, gains, model, actuators = records
    m, s = memory.view(MEMORY)[0], settings.view(SETTINGS)[0]
    fly_one(
        m,
        s,
        state[0],
        reference[0],
        gains[0],
        model[0],
        flown=flown,
        airborne=airborne,
        dt=dt,
        actuators=actuators[0],
    )


LAW = CompiledLaw(step, MEMORY)
