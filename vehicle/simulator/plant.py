"""The true dynamics of one vehicle: rotors, rigid body, drag, ground contact, battery.

Rotors and body are those of quadrotor.rigid_body. The landing gear is four feet, 0.15 m along
the body axes, folded into the plane through the body's origin: a vehicle at rest stands level with
its origin at z = 0. A foot is a spring and damper along z with Coulomb friction, whose force grows
linearly with the slip up to the limit (stiction would need the feet's memory).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rigid_body import motor_step, rk4_step, rotor_wrench
from quadrotor.rotations import quaternion_to_matrix
from quadrotor.vehicle_model import GRAVITY, MODEL, thrust_of_reference
from vehicle.simulator.parameters import SimulatorParameters

Array = npt.NDArray[np.float64]

FOOT = 0.15
"""m, from the body's z axis to a foot."""
CONTACT_HEIGHT = 0.5
"""m: above it no foot can touch, whatever the attitude."""
SLIP_DAMPING = 100.0
"""N s/m a foot, below the Coulomb limit; larger is unstable at steps of 1 ms."""
SUBSTEP = 0.001
"""s, the longest integration step."""

CELLS = 4
CELL_FULL, CELL_EMPTY = 4.2, 3.5
"""V of one cell without load; linear in charge, so that 13.8 V under load is ≈ 75 % used."""
AVIONICS_POWER = 8.0
"""W."""
POWER_PER_THRUST = 1.0 / (0.37 * math.sqrt(2.0 * 1.2 * math.pi * 0.127**2))
"""W per N^1.5: ideal hover power of a 0.254 m propeller (Sec. 2) at 37 % overall efficiency, which
makes the paper's endurance of around 10 min."""

PLANT = np.dtype(
    [
        ("x", "f8", 13),  # memory of a STATE: position_w, velocity_w, quaternion_wb, omega_b
        ("rotor_speeds", "f8", 4),  # counts of motor reference
        ("specific_force_b", "f8", 3),  # m/s^2, what an ideal accelerometer reads
        ("disturbance_w", "f8", 3),  # N, gust or pull, set from outside
        ("charge", "f8"),  # A s left
        ("voltage", "f8"),  # V at the terminals
        ("model", MODEL),
        ("thrust_efficiency", "f8"),
        ("drag", "f8"),  # N s/m
        ("stiffness", "f8"),  # N/m, a foot
        ("damping", "f8"),  # N s/m, a foot
        ("friction", "f8"),
        ("rest_depth", "f8"),  # m, compression of the gear standing still
        ("capacity", "f8"),  # A s
        ("resistance", "f8"),  # ohm
    ],
    align=True,
)


def new_plant(parameters: SimulatorParameters) -> Record:
    """A PLANT record, shape (1,), standing still and level at the origin, rotors stopped."""
    plant = np.zeros(1, PLANT)
    plant["x"][:, 6] = 1.0
    configure_plant(plant, parameters)
    plant["charge"] = parameters.battery_charge * plant["capacity"]
    plant["voltage"] = open_voltage(parameters.battery_charge)
    plant["specific_force_b"][:, 2] = GRAVITY
    return plant


def configure_plant(plant: Record, parameters: SimulatorParameters) -> None:
    """Take new true values; motion and charge stay."""
    plant["model"] = parameters.record()
    plant["thrust_efficiency"] = parameters.thrust_efficiency
    plant["drag"] = parameters.drag
    plant["stiffness"] = parameters.ground_stiffness / 4.0
    plant["damping"] = parameters.ground_damping / 4.0
    plant["friction"] = parameters.ground_friction
    plant["rest_depth"] = parameters.mass * GRAVITY / parameters.ground_stiffness
    plant["capacity"] = parameters.battery_capacity * 3600.0
    plant["resistance"] = parameters.battery_resistance


def open_voltage(charge: float) -> float:
    """V of the battery without load, at a share of its charge."""
    return CELLS * (CELL_EMPTY + (CELL_FULL - CELL_EMPTY) * charge)


@compiled
def advance(plant: Record, references: tuple[int, int, int, int], duration: float) -> None:
    """Advance a PLANT record (1,) by `duration` (s) with held motor references (counts)."""
    p = plant[0]
    x = p.x
    target = np.empty(4)
    for i in range(4):
        target[i] = references[i]
    steps = math.ceil(duration / SUBSTEP - 1e-9)
    dt = duration / steps
    wrench, force_w = np.empty(4), np.empty(3)
    for _ in range(steps):
        motor_step(p.rotor_speeds, target, p.model.motor_time_constant, dt)
        _forces(plant, wrench, force_w)
        rk4_step(x, wrench, force_w, p.model.mass, p.model.inertia_b, dt)
    _forces(plant, wrench, force_w)
    _feel(plant, wrench, force_w)
    _discharge(plant, duration)


@compiled
def _forces(plant: Record, wrench: Array, force_w: Array) -> None:
    """Wrench (4,) about body axes and further force (3,) in world axes, both N and N m."""
    p = plant[0]
    m, x = p.model, p.x
    rotors = rotor_wrench(p.rotor_speeds, m.motor_slope, m.motor_offset, m.arm, m.torque_ratio)
    for i in range(4):
        wrench[i] = rotors[i] * p.thrust_efficiency
    for i in range(3):
        force_w[i] = p.disturbance_w[i] - p.drag * x[3 + i]
    if x[2] < CONTACT_HEIGHT:
        _touch(plant, quaternion_to_matrix(x[6:10]), wrench, force_w)


@compiled
def _touch(plant: Record, R: Array, wrench: Array, force_w: Array) -> None:
    """Add what the ground does to the four feet at lever e, e = ±x_B or ±y_B, |lever| = FOOT.

    With e along x_B (sign = 1) or y_B (sign = -1) and `other` the second horizontal axis:
    omega x lever e = lever (sign omega_z) on `other` and lever (-omega_y or omega_x) on z_B;
    the torque lever e x f has -sign lever f_z about `other` and sign lever f_other about z_B.
    """
    p = plant[0]
    x = p.x
    velocity, force = np.empty(3), np.empty(3)
    for foot in range(4):
        axis, other = foot // 2, 1 - foot // 2
        sign = 1.0 - 2.0 * axis
        lever = FOOT if foot % 2 == 0 else -FOOT
        depth = p.rest_depth - (x[2] + lever * R[2, axis])
        if depth <= 0.0:
            continue
        along, up = sign * lever * x[12], -sign * lever * x[10 + other]
        for i in range(3):
            velocity[i] = x[3 + i] + R[i, other] * along + R[i, 2] * up
        normal = p.stiffness * depth - p.damping * velocity[2]
        if normal <= 0.0:
            continue
        slip = math.sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1])
        grip = SLIP_DAMPING
        if grip * slip > p.friction * normal:
            grip = p.friction * normal / slip
        force[0], force[1], force[2] = -grip * velocity[0], -grip * velocity[1], normal
        along, up = 0.0, 0.0
        for i in range(3):
            force_w[i] += force[i]
            along += R[i, other] * force[i]
            up += R[i, 2] * force[i]
        wrench[1 + other] -= sign * lever * up
        wrench[3] += sign * lever * along


@compiled
def _feel(plant: Record, wrench: Array, force_w: Array) -> None:
    """Specific force in B: everything but gravity, over the mass."""
    p = plant[0]
    R = quaternion_to_matrix(p.x[6:10])
    for i in range(3):
        f = R[0, i] * force_w[0] + R[1, i] * force_w[1] + R[2, i] * force_w[2]
        p.specific_force_b[i] = f / p.model.mass
    p.specific_force_b[2] += wrench[0] / p.model.mass


@compiled
def _discharge(plant: Record, duration: float) -> None:
    """Draw the rotors' and the avionics' power; the terminals sag by the inner resistance."""
    p = plant[0]
    power = AVIONICS_POWER
    for i in range(4):
        if p.rotor_speeds[i] > 1.0:
            f = thrust_of_reference(p.rotor_speeds[i], p.model.motor_slope, p.model.motor_offset)
            power += POWER_PER_THRUST * f * math.sqrt(f)
    current = power / max(p.voltage, 1.0)
    p.charge = max(0.0, p.charge - current * duration)
    open_cell = CELL_EMPTY + (CELL_FULL - CELL_EMPTY) * p.charge / p.capacity
    p.voltage = max(0.0, CELLS * open_cell - p.resistance * current)
