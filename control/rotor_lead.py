"""Lead of a reference by the time constant of the rotors, which makes up for their lag.

Rotors follow their commands with a lag, tau. The paper's law leaves it to the feedback, so that
force and torque are late by tau wherever a trajectory changes them. As the inverse of a first-order
lag is 1 + tau d/dt, the acceleration of the reference leads by tau jerk, along z_B where a command
can lead, and its snap, of which the torque is made, by tau times its rate from tick to tick.
"""

from __future__ import annotations

from quadrotor.compiled import compiled
from quadrotor.records import Array, Record
from quadrotor.vectors import axes_of, dot, quaternion, vector

SNAP_RATE_MAX = 1000.0
"""m/s^5, of each axis: trajectories at the limits of the vehicle have some 400; a jump has more."""


@compiled
def lead(
    reference: Record, state: Record, model: Record, snap_w: Array, dt: float, out: Record
) -> None:
    """Write a reference that leads the rotors of a model, at the attitude of a state.

    Args:
        reference, state, model: REFERENCE, STATE, MODEL, shape (1,).
        snap_w: (3,), m/s^4, the snap of the tick before; updated in place.
        dt: s since the tick before.
        out: REFERENCE, shape (1,), which may be the reference itself.
    """
    r, tau = out[0], model[0].motor_time_constant
    out[0] = reference[0]
    z_b = axes_of(quaternion(state[0].quaternion_wb))[2]
    more = tau * dot(vector(r.jerk_w), z_b)
    for i in range(3):
        rate = (r.snap_w[i] - snap_w[i]) / dt
        snap_w[i] = r.snap_w[i]
        r.acceleration_w[i] += more * z_b[i]
        r.snap_w[i] += tau * min(SNAP_RATE_MAX, max(-SNAP_RATE_MAX, rate))
