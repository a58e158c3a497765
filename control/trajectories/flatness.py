"""Inverse dynamics: the attitude, rates, thrust and torques that a reference requires.

Position and yaw are flat outputs of eqs. 2 and 3. The force m (r'' + g z_W) gives the thrust and,
with the yaw, the attitude; its first and second derivatives give the rates (Sec. 4); inverting eq.
3 gives the torques, and inverting eq. 1 the thrust of each motor.
"""

from __future__ import annotations

from control.desired_attitude import attitude_of_force
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Axes, Quaternion, Vector, add, cross, length, scale, times, vector
from quadrotor.vehicle_model import GRAVITY


@compiled(inner=True)
def wrench_of_reference(reference: Item, model: Item) -> tuple[Axes, Vector, Vector, Quaternion]:
    """Return the force and torque that one REFERENCE record requires of a vehicle with this MODEL
    record.

    Returns the columns of R_wb, the body rate (rad/s) and its derivative in body axes, and the
    wrench: thrust (N) and torques (N m) about body axes. Not finite in free fall, r'' = -g z_W.
    """
    mass = model.mass
    force = scale(mass, add(vector(reference.acceleration_w), (0.0, 0.0, GRAVITY)))
    axes, omega_b, omega_dot_b = attitude_of_force(
        force,
        scale(mass, vector(reference.jerk_w)),
        scale(mass, vector(reference.snap_w)),
        reference.yaw,
        reference.yaw_rate,
        reference.yaw_acceleration,
    )
    J = vector(model.inertia_b)
    torque = add(times(J, omega_dot_b), cross(omega_b, times(J, omega_b)))
    return axes, omega_b, omega_dot_b, (length(force), torque[0], torque[1], torque[2])
