"""The near-hovering law: small angles, linear, as the microcontroller's own mode (Secs. 3.2, 4).

The paper names it ("a standard linearized hovering controller") and gives no equations. It has two
halves, as on the vehicle: the outer one turns a desired force into thrust, roll, pitch and yaw
rate, the four numbers of the near-hovering command; the inner one holds them with PID on the angles
and P on the yaw rate. It shares gains and integrals with the geometric law, without its
feed-forward and without the coupling of large angles, so that the two can be compared in flight.
"""

from __future__ import annotations

import math

from control.allocation import allocate
from control.controller import GeometricController
from control.geometric_law import command, fed_forward, hand_over, wind
from control.position_law import desired_force, limit_force
from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rotations import wrap_angle
from quadrotor.vectors import Vector, axes_of, quaternion, subtract, vector
from quadrotor.vehicle_model import GRAVITY, Four

ANGLE_MAX = math.radians(127 / 4)
"""Largest roll and pitch, in rad, that the command's bytes can represent."""
YAW_RATE_MAX = math.radians(127)
"""Largest yaw rate, in rad/s."""


@compiled(inner=True)
def hovering_command(force_w: Vector, weight: float, yaw: float, yaw_rate: float) -> Four:
    """Return thrust (N), roll, pitch (rad) and yaw rate (rad/s) for a desired force.

    Linear about hover: f_w = R_z(yaw) (weight pitch, -weight roll, thrust).

    Args:
        force_w: N, world axes.
        yaw: rad, of the vehicle.
        yaw_rate: rad/s, commanded.
    """
    c, s = math.cos(yaw), math.sin(yaw)
    pitch = (c * force_w[0] + s * force_w[1]) / weight
    roll = (s * force_w[0] - c * force_w[1]) / weight
    return (
        force_w[2],
        min(ANGLE_MAX, max(-ANGLE_MAX, roll)),
        min(ANGLE_MAX, max(-ANGLE_MAX, pitch)),
        min(YAW_RATE_MAX, max(-YAW_RATE_MAX, yaw_rate)),
    )


@compiled(inner=True)
def hovering_torque(
    error: Vector, omega_b: Vector, integral: Vector, gains: Item, J: Vector
) -> Vector:
    """Return the torque (N m, body axes) that holds angles and yaw rate.

    Args:
        error: (roll, pitch) rad and yaw rate rad/s, commanded minus present.
        omega_b: rad/s.
        integral: rad s, of the first two errors.
        gains: one CONTROL record, per unit inertia.
        J: kg m^2.
    """
    kr, kw, kf = vector(gains.kr), vector(gains.kw), vector(gains.kf)
    return (
        J[0] * (kr[0] * error[0] + kf[0] * integral[0] - kw[0] * omega_b[0]),
        J[1] * (kr[1] * error[1] + kf[1] * integral[1] - kw[1] * omega_b[1]),
        J[2] * kw[2] * error[2],
    )


@compiled(inner=True)
def hover_one(
    memory: Item,
    state: Item,
    reference: Item,
    gains: Item,
    model: Item,
    airborne: bool,
    dt: float,
    actuators: Item,
) -> None:
    """Compute one vehicle, like control.geometric_law.step_one.

    It uses position, velocity and yaw of the reference.
    """
    weight = model.mass * GRAVITY
    axes = axes_of(quaternion(state.quaternion_wb))
    x_b, y_b, z_b = axes
    omega_b = vector(state.angular_velocity_b)
    e_p = subtract(vector(reference.position_w), vector(state.position_w))
    e_v = subtract(vector(reference.velocity_w), vector(state.velocity_w))
    hand_over(memory, gains, model)
    integral_w = vector(memory.position_integral_w)
    acceleration_w, _, _, off = fed_forward(memory.disturbance, reference, model, axes)
    force = desired_force(e_p, e_v, integral_w, acceleration_w, gains, model.mass)
    force, limited = limit_force(force, weight, gains.tan_tilt_max)
    memory.tilt_limited = 1 if limited else 0

    yaw = math.atan2(x_b[1], x_b[0])
    roll, pitch = math.atan2(y_b[2], z_b[2]), -math.asin(min(1.0, max(-1.0, x_b[2])))
    stiffness = gains.kr[2] / gains.kw[2] if gains.kw[2] > 0.0 else 0.0
    turn = reference.yaw_rate + stiffness * wrap_angle(reference.yaw - yaw)
    wanted = hovering_command(force, weight, yaw, turn)
    error = (wanted[1] - roll, wanted[2] - pitch, wanted[3] - omega_b[2])
    integral_b, J = vector(memory.attitude_integral_b), vector(model.inertia_b)
    x, y, z = hovering_torque(error, omega_b, integral_b, gains, J)
    x, y, z = x - off[0], y - off[1], z - off[2]
    bound = gains.yaw_torque_max
    thrust = wanted[0] - memory.disturbance.lift
    thrusts, scaling = allocate((thrust, x, y, min(bound, max(-bound, z))), model)

    if airborne and scaling == 1.0 and not limited:
        wind(memory.position_integral_w, e_p, dt, gains.position_integral_max)
        angles = (error[0], error[1], 0.0)
        wind(memory.attitude_integral_b, angles, dt, gains.attitude_integral_max)
    command(thrusts, scaling, model, actuators)


@compiled
def step(
    memory: Record,
    state: Record,
    reference: Record,
    gains: Record,
    model: Record,
    airborne: bool,
    dt: float,
    actuators: Record,
) -> None:
    """Compute N vehicles, like control.geometric_law.step; gains and model have shape (1,)."""
    for k in range(state.shape[0]):
        hover_one(
            memory[k],
            state[k],
            reference[k],
            gains[0],
            model[0],
            airborne,
            dt=dt,
            actuators=actuators[k],
        )


class NearHoveringController(GeometricController):
    """The near-hovering law as a `Controller`; records of shape (1,)."""

    def __init__(self) -> None:
        super().__init__(step)
