"""The true dynamics of one vehicle: rotors, rigid body, air, ground contact, battery.

Rotors and body are those of quadrotor.rigid_body. The landing gear is four feet, 0.15 m along the
body axes, folded into the plane through the body's origin: a vehicle at rest is level with its
origin at z = 0. A foot is a spring and damper along z with Coulomb friction, whose force grows
linearly with the slip up to the limit (stiction would need the feet's memory).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.constants import MOTORS
from quadrotor.records import Item, Record
from quadrotor.rigid_body import (
    Motion,
    gyroscopic_ratios,
    motion_of,
    motor_share,
    rk4,
    rotor_thrust,
    store_motion,
)
from quadrotor.vectors import (
    Axes,
    Vector,
    add,
    along,
    axes_of,
    cross,
    dot,
    scale,
    store,
    times,
    to_body,
    to_world,
    vector,
)
from quadrotor.vehicle_model import GRAVITY, MODEL, Four, wrench_of_thrusts
from vehicle.simulator.air import drag_of_rotors, ground_gain, inflow_gain
from vehicle.simulator.battery import charge_battery, discharge, follow_battery
from vehicle.simulator.faults.carried import pull_of_load, spin_of_products, swing
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.vibration import turn_rotors

Array = npt.NDArray[np.float64]

FOOT = 0.15
"""Distance, in m, from the body's z axis to a foot, where the arms are as long as the paper's."""
FOOT_SHARE = 0.6
"""The same over the length of shorter arms."""
CONTACT_HEIGHT = 0.5
"""Height, in m, above which no foot can touch the ground in any attitude."""
SLIP_DAMPING = 100.0
"""Friction, in N s/m per foot, below the Coulomb limit; larger is unstable at steps of 1 ms."""
SLIP_DAMPING_SHARE = 80.0
"""The same over the mass of a lighter vehicle, 1/s."""
SUBSTEP = 0.001
"""Longest integration step, in s."""

PLANT = np.dtype(
    [
        ("x", "f8", 13),  # memory of a STATE: position_w, velocity_w, quaternion_wb, omega_b
        ("rotor_speeds", "f8", 4),  # counts of motor reference
        ("specific_force_b", "f8", 3),  # m/s^2, what an ideal accelerometer reads
        ("disturbance_w", "f8", 3),  # N, push or pull, set by the caller
        ("charge", "f8"),  # A s left
        ("voltage", "f8"),  # V at the terminals
        ("model", MODEL),
        ("thrust_efficiency", "f8"),
        ("drag", "f8"),  # N s/m
        ("stiffness", "f8"),  # N/m, per foot
        ("damping", "f8"),  # N s/m, per foot
        ("friction", "f8"),
        ("rest_depth", "f8"),  # m, compression of the gear at rest
        ("floor_w", "f8", 3),  # normal of the floor, which contains the origin
        ("capacity", "f8"),  # A s
        ("resistance", "f8"),  # ohm
        ("battery_nominal", "f8"),  # V
        ("battery_exponent", "f8"),
        ("battery_share", "f8"),  # of the thrust at the nominal voltage, 1 for exponent 0
        ("air_w", "f8", 3),  # m/s, of the air relative to which drag acts
        ("wind_w", "f8", 3),  # m/s, its steady part
        ("gust", "f8"),  # m/s, standard deviation of the gusts per axis
        ("gust_time", "f8"),  # s, its correlation time
        ("motor_gain", "f8", 4),  # true thrust of each motor over the efficiency's
        ("ground_effect", "f8"),  # share of Cheeseman and Bennett's gain of thrust
        ("air_share", "f8"),  # of the thrust in air at rest far from the ground
        ("gusts", "f8", 5),  # memory of `blow`
        ("rotor_drag_b", "f8", 3),  # N s/m, at hover
        ("inflow_loss", "f8"),  # s/m
        ("rotor_turns", "f8", 4),  # turns of each rotor since the start, for its vibration
        ("centre_b", "f8", 2),  # m, of mass, from the middle of the rotors
        ("products_b", "f8", 3),  # kg m^2, entries xy, xz, yz of the inertia
        ("full_inverse_b", "f8", (3, 3)),  # 1/(kg m^2), of the inertia with them
        ("load_mass", "f8"),  # kg, hanging from the body's origin; 0 none
        ("load_length", "f8"),  # m, of its cable
        ("load", "f8", 6),  # its position_w and velocity_w
    ],
    align=True,
)


_SAME = (
    *("thrust_efficiency", "drag", "battery_nominal", "battery_exponent"),
    *("gust", "gust_time", "ground_effect", "inflow_loss"),
)
"""Fields that have the values of the parameters of the same name."""


def new_plant(parameters: SimulatorParameters) -> Record:
    """Return a PLANT record, shape (1,), at rest and level at the origin, rotors stopped."""
    plant = np.zeros(1, PLANT)
    plant["x"][:, 6] = 1.0
    configure_plant(plant, parameters)
    charge_battery(plant, parameters.battery_charge)
    plant["specific_force_b"][:, 2] = GRAVITY
    return plant


def configure_plant(plant: Record, parameters: SimulatorParameters) -> None:
    """Set new true values, keeping motion and charge."""
    mass = parameters.mass + parameters.payload
    plant["model"] = parameters.record()
    plant["model"]["mass"] = mass
    for name in _SAME:
        plant[name] = getattr(parameters, name)
    plant["stiffness"] = parameters.ground_stiffness / 4.0
    plant["damping"] = parameters.ground_damping / 4.0
    plant["friction"] = parameters.ground_friction
    slope = math.radians(parameters.ground_slope)
    plant["floor_w"] = -math.sin(slope), 0.0, math.cos(slope)
    plant["rest_depth"] = mass * GRAVITY / parameters.ground_stiffness
    plant["capacity"] = parameters.battery_capacity * 3600.0
    plant["resistance"] = parameters.battery_resistance
    plant["battery_share"] = plant["air_share"] = 1.0
    plant["wind_w"] = parameters.wind_x, parameters.wind_y, parameters.wind_z
    plant["air_w"] = plant["wind_w"]
    plant["disturbance_w"] = parameters.push_x, parameters.push_y, parameters.push_z
    plant["rotor_drag_b"] = parameters.rotor_drag_x, parameters.rotor_drag_y, 0.0
    gains = [getattr(parameters, f"motor_gain_{motor}") for motor in MOTORS]
    if parameters.failed_motor:
        gains[parameters.failed_motor - 1] = 0.0
    plant["motor_gain"] = gains


@compiled
def advance(plant: Record, references: Four, duration: float) -> None:
    """Advance a PLANT record (1,) by `duration` (s) with held motor references (counts)."""
    p = plant[0]
    follow_battery(p)
    p.air_share = ground_gain(p.ground_effect, p.x[2]) * inflow_gain(p)
    steps = math.ceil(duration / SUBSTEP - 1e-9)
    dt = duration / steps
    target = (
        float(references[0]),
        float(references[1]),
        float(references[2]),
        float(references[3]),
    )
    move(p, target, steps, dt, motor_share(p.model.motor_time_constant, dt))
    turn_rotors(p, duration)
    discharge(plant, duration)


@compiled(inner=True)
def move(p: Item, target: Four, steps: int, dt: float, share: float) -> None:
    """Integrate rotors and body of one PLANT record over `steps` of dt (s).

    The specific force at the end is written to the record. Rotors, drag and body are one system to
    the Runge-Kutta step: the speeds are known exactly at its middle and end, as their references
    are held, and the drag is that of each stage. These are evaluated at the step's beginning: the
    ground's force, whose friction has no second derivative, the rotors' drag, which is small and
    follows the body's axes, the pull of a hanging load, and what products of inertia add.

    Args:
        target: held motor references, counts.
        share: `motor_share` of dt.
    """
    m, s, drag = p.model, p.rotor_speeds, p.drag
    inverse_mass = 1.0 / m.mass
    J = m.inertia_b[0], m.inertia_b[1], m.inertia_b[2]
    inverse = 1.0 / J[0], 1.0 / J[1], 1.0 / J[2]
    ratios = gyroscopic_ratios(J, inverse)
    half_share = share / (1.0 + math.sqrt(1.0 - share))  # of dt / 2
    damping = drag * inverse_mass
    pull_w = along(vector(p.disturbance_w), drag, vector(p.air_w))
    has_rotor_drag = p.rotor_drag_b[0] > 0.0 or p.rotor_drag_b[1] > 0.0
    has_load, has_products = p.load_mass > 0.0, p.full_inverse_b[0, 0] > 0.0
    motion = motion_of(p.x)
    speeds = s[0], s[1], s[2], s[3]
    lift, turn = _driven(p, speeds, inverse_mass, inverse)
    for _ in range(steps):
        middle_lift, middle_turn = _driven(
            p, _approach(speeds, target, half_share), inverse_mass, inverse
        )
        speeds = _approach(speeds, target, share)
        end_lift, end_turn = _driven(p, speeds, inverse_mass, inverse)
        lifts, turns, force_w = (lift, middle_lift, end_lift), (turn, middle_turn, end_turn), pull_w
        if dot(vector(p.floor_w), motion[0]) < CONTACT_HEIGHT:
            ground_w, torque_b = _stand(p, motion)
            force_w, held = add(force_w, ground_w), times(torque_b, inverse)
            turns = add(turn, held), add(middle_turn, held), add(end_turn, held)
        if has_rotor_drag:
            force_b, torque_b = drag_of_rotors(p, motion)
            force_w = add(force_w, to_world(axes_of(motion[2]), force_b))
            drawn = times(torque_b, inverse)
            turns = add(turns[0], drawn), add(turns[1], drawn), add(turns[2], drawn)
        if has_load:
            force_w = add(force_w, swing(p, motion, dt))
        if has_products:
            rest = spin_of_products(p, motion[3], turn)
            turns = add(turns[0], rest), add(turns[1], rest), add(turns[2], rest)
        motion = rk4(motion, lifts, scale(inverse_mass, force_w), damping, turns, ratios, dt=dt)
        lift, turn = end_lift, end_turn
    store_motion(motion, p.x)
    s[0], s[1], s[2], s[3] = speeds
    # Specific force: all forces except gravity, over the mass, in B.
    force_w = along(pull_w, -drag, motion[1])
    if dot(vector(p.floor_w), motion[0]) < CONTACT_HEIGHT:
        force_w = add(force_w, _stand(p, motion)[0])
    if has_load:
        force_w = add(force_w, pull_of_load(p, motion))
    x, y, z = to_body(axes_of(motion[2]), force_w)
    if has_rotor_drag:
        x, y, z = add((x, y, z), drag_of_rotors(p, motion)[0])
    store((x * inverse_mass, y * inverse_mass, z * inverse_mass + lift), p.specific_force_b)


@compiled(inner=True)
def _approach(speeds: Four, target: Four, share: float) -> Four:
    """Return the rotor speeds (counts) after that share of the way to their references."""
    return (
        speeds[0] + share * (target[0] - speeds[0]),
        speeds[1] + share * (target[1] - speeds[1]),
        speeds[2] + share * (target[2] - speeds[2]),
        speeds[3] + share * (target[3] - speeds[3]),
    )


@compiled(inner=True)
def _driven(p: Item, speeds: Four, inverse_mass: float, inverse: Vector) -> tuple[float, Vector]:
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
    x, y = x - p.centre_b[1] * thrust, y + p.centre_b[0] * thrust
    return e * inverse_mass * thrust, times((e * x, e * y, e * z), inverse)


@compiled(inner=True)
def _stand(p: Item, motion: Motion) -> tuple[Vector, Vector]:
    """Return the ground's force in world axes (N) and torque about body axes (N m) on the feet."""
    force_w = torque_b = (0.0, 0.0, 0.0)
    axes = axes_of(motion[2])
    foot = min(FOOT, FOOT_SHARE * p.model.arm)
    for lever in (foot, -foot):
        for arm_b, along_w in (((lever, 0.0, 0.0), axes[0]), ((0.0, lever, 0.0), axes[1])):
            foot_w = _touch(p, motion, axes, arm_b, scale(lever, along_w))
            force_w = add(force_w, foot_w)
            torque_b = add(torque_b, cross(arm_b, to_body(axes, foot_w)))
    return force_w, torque_b


@compiled(inner=True)
def _touch(p: Item, motion: Motion, axes: Axes, arm_b: Vector, arm_w: Vector) -> Vector:
    """Return the force of the ground (N, world axes) on one foot.

    The foot moves with v + R (omega x arm).

    Args:
        arm_b, arm_w: place of the foot in the body, and from the body's origin in W, m.
    """
    position_w, velocity_w, _, omega_b = motion
    normal_w = vector(p.floor_w)
    depth = p.rest_depth - dot(normal_w, add(position_w, arm_w))
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    foot_w = add(velocity_w, to_world(axes, cross(omega_b, arm_b)))
    leaving = dot(normal_w, foot_w)
    normal = p.stiffness * depth - p.damping * leaving
    if normal <= 0.0:
        return 0.0, 0.0, 0.0
    slip_w = along(foot_w, -leaving, normal_w)
    slip = math.sqrt(dot(slip_w, slip_w))
    grip = min(SLIP_DAMPING, SLIP_DAMPING_SHARE * p.model.mass)
    if grip * slip > p.friction * normal:
        grip = p.friction * normal / slip
    return along(scale(normal, normal_w), -grip, slip_w)
