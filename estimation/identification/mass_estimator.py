"""Adaptive estimation of the mass from the vertical motion (Sec. 5.4, eqs. 6 to 10, corrected).

With g > 0 the vertical dynamics are z_ddot + g = v / m, with v the commanded thrust times z_B . z_W
(the paper has the other sign, with which the mass turns negative). Filtered by P = a / (s + a) on
both sides, y = a (z_dot - z_dot_fil) + g_fil = m_inv v_fil. The gradient rule d/dt m_inv = k e
v_fil, e = y - m_inv v_fil, has the rate k v_fil^2 of about 165 1/s in hover: it is integrated
exactly, because explicit Euler diverges below 82 Hz.

On the ground the reaction force carries the vehicle, so learning is off. All filters restart at
lift-off, which is exact: P acting from that moment means v_fil = g_fil = 0 and z_dot_fil = z_dot.
The result is thrust commanded over thrust needed, which is the mass divided by the thrust
efficiency.
"""

from __future__ import annotations

import math

import numpy as np

from quadrotor.compiled import compiled, direct
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import ACTUATORS, ESTIMATE, STATE, Record
from quadrotor.vehicle_model import GRAVITY

MASS_GAINS = np.dtype(
    [
        ("filter_pole", "f8"),  # rad/s
        ("gain", "f8"),  # 1/(N^2 s)
        ("mass_min", "f8"),  # kg
        ("mass_max", "f8"),  # kg
        ("variance_time", "f8"),  # s
    ],
    align=True,
)

MASS_MEMORY = np.dtype(
    [
        ("flying", "u1"),
        ("inverse_mass", "f8"),  # 1/kg
        ("thrust_filtered", "f8"),  # N, v_fil
        ("gravity_filtered", "f8"),  # m/s^2, g_fil
        ("velocity_filtered", "f8"),  # m/s, z_dot_fil
        ("mean", "f8"),  # kg, of the estimate over the variance time
        ("variance", "f8"),  # kg^2
    ],
    align=True,
)


class MassParameters(Parameters):
    """Gains of eqs. 7 to 10."""

    filter_pole: float = parameter(0.06 * math.pi, unit="rad/s", ge=0.01, le=10.0, step=0.01)
    """a of eq. 7"""
    gain: float = parameter(1.0, unit="1/(N² s)", ge=0.0, le=10.0, step=0.01)
    """k_est,m of eq. 10; 0 holds"""
    mass_min: float = parameter(0.5, unit="kg", ge=0.01, le=2.4, step=0.01, flight_step=0.2)
    """lower clamp of the estimate"""
    mass_max: float = parameter(2.4, unit="kg", ge=0.02, le=5.0, step=0.01, flight_step=0.2)
    """upper clamp of the estimate"""
    variance_time: float = parameter(1.0, unit="s", ge=0.05, le=30.0, step=0.05)
    """window of the estimate's variance"""
    converged_deviation: float = parameter(0.01, unit="kg", ge=0.0001, le=0.5, step=0.001)
    """standard deviation in flight below which the estimate has converged"""


def mass_record(parameters: MassParameters) -> Record:
    """Return the gains as one MASS_GAINS record, shape (1,)."""
    out = np.zeros(1, MASS_GAINS)
    for name in MASS_GAINS.names or ():
        out[name] = getattr(parameters, name)
    return out


def new_mass_memory(mass: float, parameters: MassParameters, count: int = 1) -> Record:
    """Return `count` estimators at `mass` (kg), with the variance of a uniform distribution between
    the clamps.
    """
    memory = np.zeros(count, MASS_MEMORY)
    memory["inverse_mass"] = 1.0 / mass
    memory["mean"] = mass
    memory["variance"] = (parameters.mass_max - parameters.mass_min) ** 2 / 12.0
    return memory


@compiled
def step(
    memory: Record,
    gains: Record,
    state: Record,
    actuators: Record,
    airborne: bool,
    dt: float,
    estimate: Record,
) -> None:
    """Make one step of (N,) estimators; write mass (kg) and mass_variance (kg^2) of (N,) ESTIMATE.

    Args:
        memory: (N,) MASS_MEMORY.
        gains: (1,) MASS_GAINS.
        state: (N,) STATE.
        actuators: (N,) ACTUATORS, whose wrench[0] is the thrust commanded since the last step.
        airborne: learning pauses while False.
        dt: s.
    """
    g = gains[0]
    for k in range(memory.shape[0]):
        m, q, speed = memory[k], state[k].quaternion_wb, state[k].velocity_w[2]
        if not airborne:
            m.flying = 0
        elif not m.flying:
            m.flying = 1 if math.isfinite(speed) else 0
            m.thrust_filtered, m.gravity_filtered, m.velocity_filtered = 0.0, 0.0, speed
        elif math.isfinite(speed + q[1] + q[2]):  # a NaN would stay, and the control law may use it
            share = -math.expm1(-g.filter_pole * dt)
            thrust = actuators[k].wrench[0] * (1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]))
            m.thrust_filtered += share * (thrust - m.thrust_filtered)
            m.gravity_filtered += share * (GRAVITY - m.gravity_filtered)
            m.velocity_filtered += share * (speed - m.velocity_filtered)
            y = g.filter_pole * (speed - m.velocity_filtered) + m.gravity_filtered
            v = m.thrust_filtered
            if abs(v) > 1e-6:
                keep = math.exp(-g.gain * v * v * dt)
                m.inverse_mass = y / v + (m.inverse_mass - y / v) * keep
            m.inverse_mass = min(max(m.inverse_mass, 1.0 / g.mass_max), 1.0 / g.mass_min)
            weight = -math.expm1(-dt / g.variance_time)
            away = 1.0 / m.inverse_mass - m.mean
            m.mean += weight * away
            m.variance = (1.0 - weight) * (m.variance + weight * away * away)
        estimate[k].mass = 1.0 / m.inverse_mass
        estimate[k].mass_variance = m.variance


class MassEstimator:
    """Holds the memory of `step` for one vehicle.

    Args:
        mass: kg, the first guess.
    """

    def __init__(self, mass: float, parameters: MassParameters | None = None) -> None:
        self.configure(parameters or MassParameters())
        self.reset(mass)
        records = self._memory, self._gains, np.zeros(1, STATE), np.zeros(1, ACTUATORS)
        self._step = direct(step, *records, True, 0.002, np.zeros(1, ESTIMATE))

    def configure(self, parameters: MassParameters) -> None:
        """Set new gains; the estimate is kept."""
        self._parameters = parameters.model_copy()
        self._gains = mass_record(parameters)

    def reset(self, mass: float) -> None:
        """Restart from a guess (kg), clamped."""
        p = self._parameters
        self._memory = new_mass_memory(min(max(mass, p.mass_min), p.mass_max), p)

    @property
    def mass(self) -> float:
        """Return the mass in kg."""
        return 1.0 / float(self._memory["inverse_mass"][0])

    @property
    def converged(self) -> bool:
        """Return whether the deviation over the last variance time is below the threshold.

        It is False until a flight has shown it: the variance only decreases in the air.
        """
        return float(self._memory["variance"][0]) < self._parameters.converged_deviation**2

    def step(
        self, state: Record, actuators: Record, airborne: bool, dt: float, estimate: Record
    ) -> None:
        """Learn from one tick; write mass and variance into the ESTIMATE. All shapes (1,)."""
        records = self._memory, self._gains, state, actuators
        self._step(*records, airborne, dt, estimate)
