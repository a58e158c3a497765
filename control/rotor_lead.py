"""Lead of a reference by the time constant of the rotors, which makes up for their lag.

Rotors follow their commands with a lag, tau. The paper's law leaves it to the feedback, so that
force and torque are late by tau wherever a trajectory changes them. As the inverse of a first-order
lag is 1 + tau d/dt, the acceleration of the reference leads by tau jerk, along z_B where a command
can lead, and its snap, of which the torque is made, by tau times its rate from tick to tick.
"""

from __future__ import annotations

import numpy as np

from quadrotor.compiled import compiled, direct
from quadrotor.records import Array, Item, Record, new_reference, new_state
from quadrotor.vectors import axes_of, dot, quaternion, vector

SNAP_RATE_MAX = 1000.0
"""m/s^5, of each axis: trajectories at the limits of the vehicle have some 400; a jump has more."""


@compiled(inner=True)
def lead(reference: Item, state: Item, model: Item, snap_w: Array, dt: float) -> None:
    """Let a REFERENCE lead in place, at the attitude of a STATE, with the rotors of a MODEL.

    Args:
        snap_w: (3,), m/s^4, the snap of the tick before; updated in place.
        dt: s since the tick before.
    """
    tau = model.motor_time_constant
    z_b = axes_of(quaternion(state.quaternion_wb))[2]
    more = tau * dot(vector(reference.jerk_w), z_b)
    for i in range(3):
        rate = (reference.snap_w[i] - snap_w[i]) / dt
        snap_w[i] = reference.snap_w[i]
        reference.acceleration_w[i] += more * z_b[i]
        reference.snap_w[i] += tau * min(SNAP_RATE_MAX, max(-SNAP_RATE_MAX, rate))


@compiled
def write_led(
    reference: Record, state: Record, model: Record, snap_w: Array, dt: float, out: Record
) -> None:
    """Write a reference that leads into another record, of shape (1,) as all; see `lead`."""
    out[0] = reference[0]
    lead(out[0], state[0], model[0], snap_w, dt)


class RotorLead:
    """References that lead, from tick to tick."""

    def __init__(self, model: Record) -> None:
        self._snap_w, self._out = np.zeros(3), new_reference()
        records = self._out, new_state(), model, self._snap_w
        self._write = direct(write_led, *records, 0.002, self._out)

    def reset(self) -> None:
        """Forget the tick before."""
        self._snap_w[:] = 0.0

    def step(self, reference: Record, state: Record, model: Record, dt: float) -> Record:
        """Return a reference that leads, shape (1,), overwritten by the next step."""
        self._write(reference, state, model, self._snap_w, dt, self._out)
        return self._out
