"""Adaptive estimation of the inertia (Sec. 5.4 of the paper: the scheme of eqs. 6 to 10 per axis).

J_i omega_i' = tau_i + (J_j - J_k) omega_j omega_k + d_i, with tau the torque of the rotors and d a
constant disturbance. Filtered by P = a / (s + a) and washed out by s / (s + b), which removes d, y
= tau_fil / J and d/dt (1/J) = k (y - tau_fil / J) tau_fil, integrated exactly as for the mass.

Details that the paper omits decide the result. The torque is that of the rotors, so the commanded
thrusts first pass the motors' lag; without it J comes out up to 38 % too large. And k must suit the
size of tau_fil, which depends on the excitation and the axis: k is a rate over the mean square of
tau_fil, so that every axis forgets equally fast. The gyroscopic term, which the paper neglects, is
included with the estimates themselves.
"""

from __future__ import annotations

import math

import numpy as np

from quadrotor.compiled import compiled
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import Record
from quadrotor.vehicle_model import Array, wrench_of_thrusts

INERTIA_GAINS = np.dtype(
    [
        ("filter_pole", "f8"),  # rad/s
        ("washout_pole", "f8"),  # rad/s
        ("rate", "f8"),  # 1/s
        ("torque_floor", "f8"),  # N m
        ("inertia_min", "f8"),  # kg m^2
        ("inertia_max", "f8"),  # kg m^2
        ("variance_time", "f8"),  # s
        ("arm", "f8"),  # m
        ("torque_ratio", "f8"),  # m
        ("motor_time_constant", "f8"),  # s
    ],
    align=True,
)

INERTIA_MEMORY = np.dtype(
    [
        ("flying", "u1"),
        ("drag_torque_b", "f8", 3),  # N m, known, besides that of the rotors
        ("root_thrusts", "f8", 4),  # sqrt(N), proportional to the rotors' speeds
        ("inverse_inertia_b", "f8", 3),  # 1/(kg m^2)
        ("torque_filtered_b", "f8", 3),  # N m
        ("torque_slow_b", "f8", 3),  # N m, of the filtered torque
        ("torque_square_b", "f8", 3),  # N^2 m^2, mean square after the washout
        ("learnt_b", "f8", 3),  # s, excited as much as torque_square_b, since the start
        ("rate_b", "f8", 3),  # rad/s, at the last step
        ("acceleration_filtered_b", "f8", 3),  # rad/s^2
        ("acceleration_slow_b", "f8", 3),  # rad/s^2, of the filtered acceleration
        ("mean_b", "f8", 3),  # kg m^2, of the estimate over the variance time
        ("variance_b", "f8", 3),  # kg^2 m^4
    ],
    align=True,
)


START, START_S = 2.0, 1.0
"""Rate at the start times the time learnt since, and that time at the start, in s."""


class InertiaParameters(Parameters):
    """Gains of the scheme about each axis."""

    filter_pole: float = parameter(2.0 * math.pi, unit="rad/s", ge=0.05, le=100.0, step=0.1)
    """a of eq. 7"""
    washout_pole: float = parameter(0.5, unit="rad/s", ge=0.01, le=10.0, step=0.05)
    """slower disturbances than this do not count"""
    rate: float = parameter(0.5, unit="1/s", ge=0.0, le=10.0, step=0.05)
    """how fast the past is forgotten; 0 holds the estimate"""
    torque_floor: float = parameter(0.003, unit="N m", ge=0.0001, le=0.1, step=0.001)
    """filtered torque below which an axis learns slower"""
    inertia_min: float = parameter(0.001, unit="kg m²", ge=1e-05, le=0.1, step=0.0001)
    """lower clamp"""
    inertia_max: float = parameter(0.2, unit="kg m²", ge=0.001, le=1.0, step=0.001)
    """upper clamp"""
    variance_time: float = parameter(1.0, unit="s", ge=0.05, le=30.0, step=0.05)
    """window of the estimate's variance"""
    converged_deviation: float = parameter(0.02, ge=0.001, le=0.5, step=0.001)
    """share of the estimate its deviation must stay below"""


_COPIED = (
    "filter_pole",
    "washout_pole",
    "rate",
    "torque_floor",
    "inertia_min",
    "inertia_max",
    "variance_time",
)


def inertia_record(
    parameters: InertiaParameters, *, arm: float, torque_ratio: float, motor_time_constant: float
) -> Record:
    """Return one INERTIA_GAINS record, shape (1,); lengths in m, the time constant in s."""
    out = np.zeros(1, INERTIA_GAINS)
    for name in _COPIED:
        out[name] = getattr(parameters, name)
    out["arm"], out["torque_ratio"] = arm, torque_ratio
    out["motor_time_constant"] = motor_time_constant
    return out


def new_inertia_memory(inertia_b: Array, parameters: InertiaParameters) -> Record:
    """Return one estimator at a guess (3,) in kg m^2, with the variance of a uniform distribution
    between the clamps.
    """
    memory = np.zeros(1, INERTIA_MEMORY)
    memory["inverse_inertia_b"] = 1.0 / np.asarray(inertia_b)
    memory["mean_b"] = inertia_b
    memory["variance_b"] = (parameters.inertia_max - parameters.inertia_min) ** 2 / 12.0
    return memory


@compiled
def step(
    memory: Record, gains: Record, state: Record, actuators: Record, airborne: bool, dt: float
) -> None:
    """Make one step of one estimator; all records have the shape (1,).

    Args:
        state: STATE with the present angular velocity.
        actuators: ACTUATORS whose thrusts were commanded since the last step.
        airborne: learning pauses while False.
        dt: s.
    """
    g, m, rate = gains[0], memory[0], state[0].angular_velocity_b
    follow = -math.expm1(-dt / g.motor_time_constant)
    for i in range(4):
        root = math.sqrt(max(0.0, actuators[0].thrusts[i]))
        m.root_thrusts[i] += follow * (root - m.root_thrusts[i])
    if not airborne:
        m.flying = 0
        return
    if not m.flying:
        m.flying = 1
        for i in range(3):
            m.torque_filtered_b[i], m.rate_b[i], m.acceleration_filtered_b[i] = 0.0, rate[i], 0.0
            m.torque_slow_b[i], m.acceleration_slow_b[i] = 0.0, 0.0
        return
    r = m.root_thrusts
    wrench = wrench_of_thrusts(
        (r[0] * r[0], r[1] * r[1], r[2] * r[2], r[3] * r[3]), g.arm, g.torque_ratio
    )
    share = -math.expm1(-g.filter_pole * dt)
    slow = -math.expm1(-g.washout_pole * dt)
    forget = -math.expm1(-g.rate * dt)
    weight = -math.expm1(-dt / g.variance_time)
    for i in range(3):
        j, l = (i + 1) % 3, (i + 2) % 3  # noqa: E741 - the axes in turn
        torque = wrench[i + 1] + m.drag_torque_b[i]
        torque += rate[j] * rate[l] * (1.0 / m.inverse_inertia_b[j] - 1.0 / m.inverse_inertia_b[l])
        m.torque_filtered_b[i] += share * (torque - m.torque_filtered_b[i])
        # Exact for a rate that is linear in between: a (omega - omega_fil) is too small by a dt /
        # 2.
        y = m.acceleration_filtered_b[i]
        y += share * ((rate[i] - m.rate_b[i]) / dt - y)
        m.rate_b[i], m.acceleration_filtered_b[i] = rate[i], y
        m.torque_slow_b[i] += slow * (m.torque_filtered_b[i] - m.torque_slow_b[i])
        m.acceleration_slow_b[i] += slow * (y - m.acceleration_slow_b[i])
        y -= m.acceleration_slow_b[i]
        tau = m.torque_filtered_b[i] - m.torque_slow_b[i]
        m.torque_square_b[i] += forget * (tau * tau - m.torque_square_b[i])
        if abs(tau) > 1e-9:
            strength = tau * tau * dt / max(m.torque_square_b[i], g.torque_floor * g.torque_floor)
            pace = max(g.rate, START / (m.learnt_b[i] + START_S)) if g.rate > 0.0 else 0.0
            keep = math.exp(-pace * strength)
            m.learnt_b[i] += strength
            inverse = y / tau + (m.inverse_inertia_b[i] - y / tau) * keep
            m.inverse_inertia_b[i] = min(max(inverse, 1.0 / g.inertia_max), 1.0 / g.inertia_min)
        away = 1.0 / m.inverse_inertia_b[i] - m.mean_b[i]
        m.mean_b[i] += weight * away
        m.variance_b[i] = (1.0 - weight) * (m.variance_b[i] + weight * away * away)


class InertiaEstimator:
    """Holds the memory of `step` for one vehicle.

    Args:
        inertia_b: (3,) kg m^2, the first guess.
        arm, torque_ratio: m.
        motor_time_constant: s.
    """

    def __init__(
        self,
        inertia_b: Array,
        *,
        arm: float,
        torque_ratio: float,
        motor_time_constant: float,
        parameters: InertiaParameters | None = None,
    ) -> None:
        self._parameters = parameters or InertiaParameters()
        self._gains = inertia_record(
            self._parameters,
            arm=arm,
            torque_ratio=torque_ratio,
            motor_time_constant=motor_time_constant,
        )
        self.reset(inertia_b)

    def reset(self, inertia_b: Array) -> None:
        """Restart from a guess (3,), clamped."""
        p = self._parameters
        self._memory = new_inertia_memory(np.clip(inertia_b, p.inertia_min, p.inertia_max), p)

    @property
    def inertia_b(self) -> Array:
        """Return the inertia (3,) in kg m^2, about body x, y, z."""
        return 1.0 / np.array(self._memory["inverse_inertia_b"][0])

    @property
    def deviation_b(self) -> Array:
        """Return the standard deviation (3,) in kg m^2 of the estimate over the last
        variance time.
        """
        deviation: Array = np.sqrt(self._memory["variance_b"][0])
        return deviation

    @property
    def learnt_b(self) -> Array:
        """Return the time (3,) in s since the start, in which each axis was excited."""
        return np.array(self._memory["learnt_b"][0])

    @property
    def torque_b(self) -> Array:
        """Return the recent root mean square (3,) in N m of the filtered torque: the strength of
        the excitation.
        """
        torque: Array = np.sqrt(self._memory["torque_square_b"][0])
        return torque

    @property
    def converged(self) -> bool:
        """Return whether all three axes have converged; False until a flight has shown it."""
        limit = self._parameters.converged_deviation * self.inertia_b
        return bool((self.deviation_b < limit).all())

    def step(
        self,
        state: Record,
        actuators: Record,
        airborne: bool,
        dt: float,
        drag_torque_b: Array | None = None,
    ) -> None:
        """Learn from one tick, with a torque (3,) in N m that is known besides the rotors'."""
        if drag_torque_b is not None:
            self._memory["drag_torque_b"] = drag_torque_b
        step(self._memory, self._gains, state, actuators, airborne, dt)
