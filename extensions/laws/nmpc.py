"""Nonlinear model predictive control of position and attitude, by one step of iLQR a tick.

S. Sun, A. Romero, P. Foehn, E. Kaufmann, D. Scaramuzza, "A comparative study of nonlinear MPC and
differential-flatness-based control for quadrotor agile flight", IEEE T-RO 38(6), 2022 (20 nodes);
D. Hanover, P. Foehn, S. Sun, E. Kaufmann, D. Scaramuzza, "Performance, precision, and payloads:
adaptive nonlinear MPC for quadrotors", RA-L 2022 (the L1 estimate in the model); Y. Tassa,
N. Mansard, E. Todorov, "Control-limited differential dynamic programming", ICRA 2014; M. Diehl et
al., "Real-time optimization and nonlinear model predictive control", J. Process Control 12, 2002
(one iteration for each sample, from the last solution).

State (p, v, q, omega), inputs u = thrusts of the four rotors, N nodes of h:

    p+ = p + h v + h^2/2 a,  q+ = q exp(h omega + h^2/2 omega')
    v+ = v + h a,            omega+ = omega + h omega'
    a = (sum u / m + sigma_z) z_B(q exp(h/2 omega + h^2/8 omega')) + sigma_xy - g z_W - d v
    omega' = J^-1 (M_tau u - omega x J omega) + sigma_tau
    cost = sum 1/2 |x - x_r|_Q^2 + 1/2 |u - u_r|_R^2 within f_min <= u <= f_max

with x_r, u_r of the flat outputs, and sigma of `adaptation`. With z_B(q) the plan would lead by
h/2. The step is Gauss-Newton's, in the error (dp, dv, dtheta, domega), without the derivative of
omega x J omega. With rotors as inputs, enough thrust stays for the attitude. The plan begins one
time constant of the rotors later, where their thrusts lead. The reference is continued as the
harmonic motion that its derivatives describe, with the rest of jerk and snap as a polynomial.
"""

from __future__ import annotations

import math

import numpy as np

from control.laws import CompiledLaw, Own, Records, settings_type
from extensions.laws.adaptation import ADAPTATION, adapt, bounded, rest
from extensions.laws.desired import finish
from extensions.laws.nmpc_model import (
    INPUTS,
    NODES,
    STATES,
    Push,
    advance,
    difference,
    linearize,
    look_ahead,
)
from extensions.laws.parameters import NmpcParameters
from extensions.laws.small_matrices import multiply_into, solve
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.rigid_body import rotor_thrust
from quadrotor.vectors import Vector, vector
from quadrotor.vehicle_model import wrench_of_thrusts

POLE = 1.0
"""1/s, decay of the errors of the adaptation's predictor."""
SETTINGS = settings_type(NmpcParameters)
MEMORY = np.dtype(
    [
        ("running", "i8"),
        ("x", "f8", (NODES + 1, 13)),  # p (m), v (m/s), q, omega (rad/s)
        ("u", "f8", (NODES, INPUTS)),  # N
        ("x_r", "f8", (NODES + 1, 13)),
        ("u_r", "f8", (NODES, INPUTS)),
        ("gain", "f8", (NODES, INPUTS, STATES)),
        ("change", "f8", (NODES, INPUTS)),
        ("V", "f8", (STATES, STATES)),  # second derivative of the cost to go
        ("g", "f8", STATES),  # its gradient
        ("A", "f8", (STATES, STATES)),
        ("B", "f8", (STATES, INPUTS)),
        ("VA", "f8", (STATES, STATES)),
        ("VB", "f8", (STATES, INPUTS)),
        ("H", "f8", (INPUTS, INPUTS)),  # Q_uu
        ("K", "f8", (INPUTS, STATES + 1)),  # Q_ux and Q_u, and their solution
        ("error", "f8", STATES),
        ("x_now", "f8", 13),
        ("x_then", "f8", 13),
        ("acting", "f8", INPUTS),  # N, of the rotors at present
        ("adaptation", ADAPTATION),
        ("low", "f8"),  # N
        ("high", "f8"),
    ],
    align=True,
)


@compiled(inner=True)
def weights_of(s: Item) -> tuple[Vector, Vector, Vector, Vector]:
    """Return the weights of position, velocity, attitude and rates."""
    return (
        (s.position_xy, s.position_xy, s.position_z),
        (s.velocity, s.velocity, s.velocity),
        (s.tilt, s.tilt, s.yaw),
        (s.rates, s.rates, s.rates),
    )


@compiled(inner=True)
def add_cost(m: Item, s: Item, k: int, share: float) -> None:
    """Add the cost of the state at node k to V and g."""
    difference(m.x[k], m.x_r[k], m.error)
    position, velocity, attitude, rates = weights_of(s)
    for i in range(3):
        m.V[i, i] += share * position[i]
        m.V[3 + i, 3 + i] += share * velocity[i]
        m.V[6 + i, 6 + i] += share * attitude[i]
        m.g[i] += share * position[i] * m.error[i]
        m.g[3 + i] += share * velocity[i] * m.error[3 + i]
        m.g[6 + i] += share * attitude[i] * m.error[6 + i]
        m.V[9 + i, 9 + i] += share * rates[i]
        m.g[9 + i] += share * rates[i] * m.error[9 + i]


@compiled(inner=True)
def gains_at(m: Item, s: Item, k: int) -> None:
    """Write gain and change of the inputs at node k; an input at its bound does not move."""
    multiply_into(m.V, m.A, m.VA)
    multiply_into(m.V, m.B, m.VB)
    for i in range(INPUTS):
        for j in range(INPUTS):
            m.H[i, j] = s.thrust if i == j else 0.0
            for n in range(STATES):
                m.H[i, j] += m.B[n, i] * m.VB[n, j]
        for j in range(STATES):
            m.K[i, j] = 0.0
            for n in range(STATES):
                m.K[i, j] += m.B[n, i] * m.VA[n, j]
        m.K[i, STATES] = s.thrust * (m.u[k, i] - m.u_r[k, i])
        for n in range(STATES):
            m.K[i, STATES] += m.B[n, i] * m.g[n]
    for i in range(INPUTS):
        slope = m.K[i, STATES]
        at_end = (m.u[k, i] <= m.low and slope > 0.0) or (m.u[k, i] >= m.high and slope < 0.0)
        if at_end:
            for j in range(INPUTS):
                m.H[i, j] = m.H[j, i] = 1.0 if i == j else 0.0
            for j in range(STATES + 1):
                m.K[i, j] = 0.0
    solve(m.H, m.K, STATES + 1)
    for i in range(INPUTS):
        m.change[k, i] = -m.K[i, STATES]
        for j in range(STATES):
            m.gain[k, i, j] = -m.K[i, j]


@compiled(inner=True)
def backward(m: Item, s: Item, push: Push, spin: Vector, model: Item, h: float) -> None:
    """Compute gains and changes from the last node to the first.

    With u = k + K x the cost to go is that of the closed loop, so V = Q + A'V(A + B K) is symmetric
    up to rounding, and is made so.
    """
    m.V[:] = 0.0
    m.g[:] = 0.0
    add_cost(m, s, NODES, s.last)
    for k in range(NODES - 1, -1, -1):
        linearize(m, k, push[0], spin, model, h)
        gains_at(m, s, k)
        # V (A + B K) and g + V B k
        for i in range(STATES):
            for n in range(INPUTS):
                m.g[i] += m.VB[i, n] * m.change[k, n]
                for j in range(STATES):
                    m.VA[i, j] += m.VB[i, n] * m.gain[k, n, j]
        for i in range(STATES):
            value = 0.0
            for n in range(STATES):
                value += m.A[n, i] * m.g[n]
            m.error[i] = value
            for j in range(STATES):
                value = 0.0
                for n in range(STATES):
                    value += m.A[n, i] * m.VA[n, j]
                m.V[i, j] = value
        for i in range(STATES):
            m.g[i] = m.error[i]
            for j in range(i):
                m.V[i, j] = m.V[j, i] = 0.5 * (m.V[i, j] + m.V[j, i])
        if k > 0:
            add_cost(m, s, k, 1.0)


@compiled(inner=True)
def forward(
    m: Item, state: Item, push: Push, spin: Vector, model: Item, airborne: bool, h: float
) -> None:
    """Fly the model with the new, bounded inputs, in the air from where the rotors lead first."""
    x = m.x_now
    for i in range(3):
        x[i], x[3 + i] = state.position_w[i], state.velocity_w[i]
        x[10 + i] = state.angular_velocity_b[i]
    for i in range(4):
        x[6 + i] = state.quaternion_wb[i]
        speed = m.adaptation.rotor_speeds[i]
        m.acting[i] = rotor_thrust(speed, model.motor_slope, model.motor_offset)
    ahead = model.motor_time_constant if airborne else 0.0  # the ground carries the rest
    advance(x, m.acting, push, spin, model, h=ahead, out=m.x_then)
    x = m.x_then
    for k in range(NODES):
        difference(x, m.x[k], m.error)
        for i in range(13):
            m.x[k, i] = x[i]
        for i in range(INPUTS):
            value = m.u[k, i] + m.change[k, i]
            for j in range(STATES):
                value += m.gain[k, i, j] * m.error[j]
            m.u[k, i] = min(m.high, max(m.low, value))
        advance(m.x[k], m.u[k], push, spin, model, h=h, out=x)
    for i in range(13):
        m.x[NODES, i] = x[i]


@compiled(inner=True)
def begin(m: Item) -> None:
    """Begin with the trajectory of the reference."""
    m.running = 1
    for k in range(NODES + 1):
        for i in range(13):
            m.x[k, i] = m.x_r[k, i]
    for k in range(NODES):
        for i in range(INPUTS):
            m.u[k, i] = min(m.high, max(m.low, m.u_r[k, i]))


@compiled(inner=True)
def learn(m: Item, s: Item, state: Item, model: Item, actuators: Item, dt: float) -> Push:
    """Advance the adaptation; return the acceleration (m/s^2) that the model lacks."""
    a, none = m.adaptation, (0.0, 0.0, 0.0, 0.0)
    tuning = (POLE, POLE), (s.force_cutoff, s.torque_cutoff)
    adapt(a, tuning, state, model, actuators, dt)
    most = s.force_max / model.mass
    found = (
        bounded(a.lift, most),
        bounded(a.across_w[0], most),
        bounded(a.across_w[1], most),
        bounded(a.across_w[2], most),
    )
    return found if s.adaptive == 1 else none


@compiled(inner=True)
def learned_spin(m: Item, s: Item, model: Item) -> Vector:
    """Return the angular acceleration (rad/s^2) that the model lacks."""
    J, found, most = vector(model.inertia_b), m.adaptation.filtered_turn_b, s.torque_max
    if s.adaptive == 0:
        return 0.0, 0.0, 0.0
    return (
        bounded(found[0], most / J[0]),
        bounded(found[1], most / J[1]),
        bounded(found[2], most / J[2]),
    )


@compiled(inner=True)
def fly_one(
    m: Item,
    s: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one tick; see `control.laws`."""
    h, push, spin = s.horizon / NODES, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if m.running == 0 or not airborne:
        rest(m.adaptation, state, actuators)
    if airborne:
        push, spin = learn(m, s, state, model, actuators, dt), learned_spin(m, s, model)
    m.low, m.high = model.thrust_min, model.thrust_max
    look_ahead(m, reference, model, push, spin, h)
    if m.running == 0 or not math.isfinite(m.x[NODES, 0] + m.u[0, 0]):
        begin(m)
    backward(m, s, push, spin, model, h)
    forward(m, state, push, spin, model, airborne, h=h)
    thrusts = m.u[0, 0], m.u[0, 1], m.u[0, 2], m.u[0, 3]
    thrust, x, y, z = wrench_of_thrusts(thrusts, model.arm, model.torque_ratio)
    finish(thrust, (x, y, z), gains.yaw_torque_max, model, actuators)


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
        airborne=airborne,
        dt=dt,
        actuators=actuators[0],
    )


LAW = CompiledLaw(step, MEMORY, leads=False)
