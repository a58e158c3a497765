"""A disturbance observer: the force and torque on the vehicle in addition to those of its motors.

The model's motion, driven by the commanded thrusts (through the rotors' lag) and by the estimated
disturbance, is compared with the measured motion: with w' = u_1 z_B / m - g z_W + d and d = a (v -
w), the estimate is the true disturbance behind a low pass a / (s + a). The same applies to the
rotation, with J omega' + omega x J omega = tau + J t. Velocity and angular velocity are the
estimator's, so errors of its attitude or its accelerometer also count as a disturbance and are
subtracted in the same frame. The observer uses no reference and no gain of the law, so saturated
thrusts cause no wind-up.

The force is split as in L1 adaptive control of quadrotors (Wu et al. 2025): along z_B, where thrust
cancels it at once, and across, towards which the vehicle has to turn. That along z_B turns with the
vehicle, as that of a wrong mass or a weak motor does; filtered in world axes it would be late in
each turn.

The law subtracts the force across z_B from f_d (eq. 4), that along z_B from u_1, and the torque
from tau (eq. 5), each faded in and out and within its bound; what exceeds the bound is left to the
law's integrals. Flying on an estimated
mass (`mass.used_by`) changes the model: the observer estimates what that mass leaves.
"""

from __future__ import annotations

import math

import numpy as np

from control.modelled_motion import modelled
from control.parameters import DisturbanceParameters
from quadrotor.compiled import compiled, direct
from quadrotor.records import ACTUATORS, STATE, Item, Record
from quadrotor.vectors import axes_of, dot, quaternion, scale, vector
from quadrotor.vehicle_model import Four, VehicleModel

RATE_POLE = 20.0
"""Low pass, in rad/s, of the force's rate, which turns the vehicle before its tilt is wrong."""
CURVE_POLE = 10.0
"""Low pass, in rad/s, of the rate's rate. Twice as fast, gusts leave a sixth less error, and strong
vibration twice as much on the error-state filter."""
SETTLED = 3.0
"""Shortest fade-in, in time constants of the low pass: the observer must have an estimate before it
replaces the law's integral."""

OBSERVER = np.dtype(
    [
        ("force", "i8"),  # 1: subtracted from the desired force
        ("torque", "i8"),  # 1: subtracted from the torque
        ("force_bandwidth", "f8"),  # rad/s
        ("torque_bandwidth", "f8"),  # rad/s
        ("force_max", "f8"),  # N, each axis
        ("torque_max", "f8"),  # N m, each axis
        ("fade", "f8"),  # s
    ],
    align=True,
)

OBSERVER_MEMORY = np.dtype(
    [
        ("running", "i8"),  # 1 once the model's motion has begun at the measured one, 2 while it
        # is first faded in after take-off, -1 on the ground
        ("rotor_speeds", "f8", 4),  # counts, of the model
        ("velocity_w", "f8", 3),  # m/s, the model's
        ("angular_velocity_b", "f8", 3),  # rad/s, the model's
        ("acceleration_w", "f8", 3),  # m/s^2, the disturbing force over the mass
        ("z_w", "f8", 3),  # z_B of the last step
        ("slow_acceleration_w", "f8", 3),  # m/s^2, that across z_B behind RATE_POLE
        ("rate_w", "f8", 3),  # m/s^3, of that across z_B
        ("slow_rate_w", "f8", 3),  # m/s^3, the same behind CURVE_POLE
        ("turn_b", "f8", 3),  # rad/s^2, the disturbing torque over the inertia
        ("force_share", "f8"),  # 0..1, how far the force is faded in
        ("torque_share", "f8"),  # 0..1
    ],
    align=True,
)

DISTURBANCE = np.dtype(
    [
        ("force_w", "f8", 3),  # N, world axes
        ("lift", "f8"),  # N, what of it is along z_B and subtracted from the thrust
        ("force_rate_w", "f8", 3),  # N/s, of the rest, across z_B
        ("force_curve_w", "f8", 3),  # N/s^2, the rate of that
        ("torque_b", "f8", 3),  # N m, body axes
        ("force_begun", "f8"),  # 0..1, share of the law's integral that it now replaces
        ("torque_begun", "f8"),
        ("force_ended_w", "f8", 3),  # N, no longer subtracted: returned to the integral
        ("torque_ended_b", "f8", 3),  # N m
    ],
    align=True,
)
"""Force and torque that a law subtracts; the last four fields act once, on its integrals, so that
nothing jumps when the observer is faded in or out."""


def observer_record(parameters: DisturbanceParameters) -> Record:
    """Return the parameters as one OBSERVER record, shape (1,)."""
    return np.array([tuple(getattr(parameters, name) for name in OBSERVER.names or ())], OBSERVER)


@compiled(inner=True)
def observe_one(
    memory: Item,
    state: Item,
    actuators: Item,
    settings: Item,
    model: Item,
    flying: bool,
    carried: bool,
    dt: float,
    out: Item,
) -> None:
    """Run one step for one vehicle: write the force and torque that the law has to subtract into
    `out`.

    Args:
        actuators: the commands over the last dt (s).
        flying: whether it is airborne on this law's own thrusts; False resets the estimate.
        carried: whether the ground carries part of the weight; the estimate is held.
    """
    m = memory
    target = quaternion(actuators.motor_references)
    if not flying:
        _forget(m, target, out)
        return
    moved, spun = state.velocity_w, state.angular_velocity_b
    if not math.isfinite(moved[0] + moved[1] + moved[2] + spun[0] + spun[1] + spun[2]):
        return  # a NaN would persist
    pole, spin = settings.force_bandwidth, settings.torque_bandwidth
    keep, keep_spin = -math.expm1(-pole * dt), -math.expm1(-spin * dt)
    if m.running <= 0 or carried:
        if m.running <= 0:
            m.running = 1 if m.running == 0 else 2
        z_w = axes_of(quaternion(state.quaternion_wb))[2]
        for i in range(4):
            m.rotor_speeds[i] = target[i]
        for i in range(3):  # start the model's motion such that the estimate continues
            away = m.acceleration_w[i] * dt * (1.0 - keep) / keep
            m.velocity_w[i] = state.velocity_w[i] - away
            m.z_w[i] = z_w[i]
            away = m.turn_b[i] * dt * (1.0 - keep_spin) / keep_spin
            m.angular_velocity_b[i] = state.angular_velocity_b[i] - away
    else:
        _advance(m, state, target, (keep, keep_spin), model, dt)
    _take(m, settings, model, dt, out)


@compiled(inner=True)
def _advance(
    m: Item, state: Item, target: Four, keeps: tuple[float, float], model: Item, dt: float
) -> None:
    """Advance the model's motion, and with it the estimate, over the last dt (s).

    Args:
        keeps: shares of the difference of measured and modelled motion that are taken over.
    """
    keep, keep_spin = keeps
    push_w, turn = modelled(m, state, target, model, dt)
    z_w = axes_of(quaternion(state.quaternion_wb))[2]
    turned = dot(vector(m.acceleration_w), vector(m.z_w)) * dt * (1.0 - keep) / keep
    w, v = m.velocity_w, m.angular_velocity_b
    for i in range(3):
        w[i] += dt * push_w[i] - turned * (z_w[i] - m.z_w[i])
        m.z_w[i] = z_w[i]
        away = keep * (state.velocity_w[i] - w[i])
        w[i] += away
        m.acceleration_w[i] = away / dt
        v[i] += dt * turn[i]
        away = keep_spin * (state.angular_velocity_b[i] - v[i])
        v[i] += away
        m.turn_b[i] = away / dt
    blur, blur_rate = -math.expm1(-RATE_POLE * dt), -math.expm1(-CURVE_POLE * dt)
    lift = dot(vector(m.acceleration_w), z_w)
    for i in range(3):
        across = m.acceleration_w[i] - lift * z_w[i]
        m.slow_acceleration_w[i] += blur * (across - m.slow_acceleration_w[i])
        m.rate_w[i] = RATE_POLE * (across - m.slow_acceleration_w[i])
        m.slow_rate_w[i] += blur_rate * (m.rate_w[i] - m.slow_rate_w[i])


@compiled(inner=True)
def _towards(share: float, target: int, step: float) -> float:
    return min(1.0, share + step) if target == 1 else max(0.0, share - step)


@compiled(inner=True)
def _forget(m: Item, target: Four, out: Item) -> None:
    m.running = -1
    m.force_share = m.torque_share = 0.0
    for i in range(4):
        m.rotor_speeds[i] = target[i]
    for i in range(3):
        m.acceleration_w[i] = m.slow_acceleration_w[i] = m.turn_b[i] = 0.0
        m.rate_w[i] = m.slow_rate_w[i] = 0.0
        out.force_w[i] = out.force_rate_w[i] = out.force_curve_w[i] = out.torque_b[i] = 0.0
        out.force_ended_w[i] = out.torque_ended_b[i] = 0.0
    out.lift = out.force_begun = out.torque_begun = 0.0


@compiled(inner=True)
def _take(m: Item, settings: Item, model: Item, dt: float, out: Item) -> None:
    """Write the disturbance within its bounds, as far as it is faded in.

    A force at its bound has no rate. Fading in by d from a share s leaves the integral (1 - s - d)
    / (1 - s) of its value, as it has compensated the same disturbance. Fading out returns what is
    no longer subtracted.
    """
    force_before, torque_before = m.force_share, m.torque_share
    # After take-off the integrals do not yet hold anything to be replaced slowly.
    settled = SETTLED if m.running == 1 else 0.0
    slowness = max(settings.fade, settled / settings.force_bandwidth)
    m.force_share = _towards(force_before, settings.force, dt / slowness)
    slowness = max(settings.fade, settled / settings.torque_bandwidth)
    m.torque_share = _towards(torque_before, settings.torque, dt / slowness)
    if m.force_share == settings.force and m.torque_share == settings.torque:
        m.running = 1
    out.force_begun = _begun(force_before, m.force_share)
    out.torque_begun = _begun(torque_before, m.torque_share)
    force_ended = max(0.0, force_before - m.force_share)
    torque_ended = max(0.0, torque_before - m.torque_share)
    force = scale(model.mass, vector(m.acceleration_w))
    bound, twist, J = settings.force_max, settings.torque_max, model.inertia_b
    lift = dot(force, vector(m.z_w))
    out.lift = m.force_share * min(bound, max(-bound, lift))
    for i in range(3):
        free = abs(force[i]) < bound
        found = min(bound, max(-bound, force[i]))
        out.force_w[i] = m.force_share * found
        out.force_ended_w[i] = force_ended * found
        moving = m.force_share * model.mass if free else 0.0
        out.force_rate_w[i] = moving * m.rate_w[i]
        out.force_curve_w[i] = moving * CURVE_POLE * (m.rate_w[i] - m.slow_rate_w[i])
        found = min(twist, max(-twist, J[i] * m.turn_b[i]))
        out.torque_b[i] = m.torque_share * found
        out.torque_ended_b[i] = torque_ended * found


@compiled(inner=True)
def _begun(before: float, after: float) -> float:
    return (after - before) / (1.0 - before) if after > before else 0.0


@compiled
def observe(
    memory: Record,
    state: Record,
    actuators: Record,
    settings: Record,
    model: Record,
    flying: bool,
    carried: bool,
    dt: float,
    out: Record,
) -> None:
    """Run `observe_one` for Python: records of shape (1,)."""
    observe_one(
        memory[0],
        state[0],
        actuators[0],
        settings[0],
        model[0],
        flying,
        carried=carried,
        dt=dt,
        out=out[0],
    )


class DisturbanceObserver:
    """The observer of one vehicle; compiles when created, since it may be switched on in flight.

    Attributes:
        memory: OBSERVER_MEMORY, shape (1,).
        idle: whether it is switched off and faded out, so that no step is needed.
    """

    def __init__(self, parameters: DisturbanceParameters) -> None:
        self.memory = np.zeros(1, OBSERVER_MEMORY)
        self._wanted, self.idle = False, True
        self.configure(parameters)
        blank = np.zeros(1, STATE), np.zeros(1, ACTUATORS)
        records = self.memory, *blank, self._settings, VehicleModel().record()
        self._observe = direct(observe, *records, True, True, 0.002, np.zeros(1, DISTURBANCE))

    def configure(self, parameters: DisturbanceParameters) -> None:
        """Set new settings, keeping the estimate."""
        self._settings = observer_record(parameters)
        wanted = bool(parameters.force or parameters.torque)
        if wanted and self.idle:  # the estimate is out of date
            self.memory[...] = 0
        self._wanted = wanted
        self.idle = not wanted and self._faded_out

    def step(
        self,
        state: Record,
        actuators: Record,
        model: Record,
        flying: bool,
        carried: bool,
        dt: float,
        out: Record,
    ) -> None:
        """Compute one tick into the DISTURBANCE `out`, see `observe_one`; records of shape (1,)."""
        records = self.memory, state, actuators, self._settings, model
        self._observe(*records, flying, carried, dt, out)
        self.idle = not self._wanted and self._faded_out

    @property
    def _faded_out(self) -> bool:
        share = self.memory["force_share"].item() + self.memory["torque_share"].item()
        return not share > 0.0
