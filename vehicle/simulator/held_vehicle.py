"""The simulated vehicle while it is held in a hand or fixed on a bench.

Rotors turn and the battery drains as usual; hand or bench absorb their forces. The hand lifts the
vehicle, turns it and holds it still; then the accelerometer measures gravity alone. When it lets
go, it sets the vehicle down level.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Record
from quadrotor.rigid_body import motor_share
from quadrotor.rotations import (
    quaternion_conjugate,
    quaternion_exp,
    quaternion_from_euler,
    quaternion_log,
    quaternion_multiply,
    quaternion_normalize,
    rotate_inverse,
    yaw_of,
)
from quadrotor.vehicle_model import GRAVITY, Four
from vehicle.simulator.battery import discharge, follow_battery
from vehicle.simulator.parameters import SimulatorParameters

FREE, HAND, BENCH, SET_DOWN = range(4)
TURN_RATE = math.radians(60.0)
"""Fastest rotation by hand, in rad/s."""
LIFT_HEIGHT, LIFT_SPEED, LIFT_ACCELERATION = 0.6, 0.3, 1.0
"""Height in m, largest speed in m/s, and acceleration in m/s²."""
AT_HEIGHT = 1e-4
"""Distance in m from the height at which the hand holds still."""

HOLDER = np.dtype([("held", "i8"), ("quaternion_wb", "f8", 4)], align=True)


def new_holder() -> Record:
    """Return a HOLDER record, shape (1,), that holds nothing."""
    holder = np.zeros(1, HOLDER)
    holder["quaternion_wb"][:, 0] = 1.0
    return holder


def configure_holder(holder: Record, plant: Record, parameters: SimulatorParameters) -> None:
    """Hold a PLANT (1,), turn it to another attitude, or let go of it."""
    p, held = parameters, int(holder["held"][0])
    if p.held == "hand":
        angles = np.radians((p.hand_roll, p.hand_pitch, p.hand_yaw))
        holder["held"], holder["quaternion_wb"] = HAND, quaternion_from_euler(*angles)
    elif p.held == "bench":
        if held != BENCH:
            level = _level(plant)
            holder["held"], holder["quaternion_wb"] = BENCH, level
            plant["x"][0, 2:6], plant["x"][0, 6:10], plant["x"][0, 10:] = 0.0, level, 0.0
    elif held == HAND:
        holder["held"], holder["quaternion_wb"] = SET_DOWN, _level(plant)
    elif held == BENCH:
        holder["held"] = FREE


def _level(plant: Record) -> npt.NDArray[np.float64]:
    return quaternion_from_euler(0.0, 0.0, yaw_of(plant["x"][0, 6:10]))


@compiled
def hold(plant: Record, holder: Record, references: Four, duration: float) -> None:
    """Advance a held PLANT (1,) by `duration` (s), in place of `plant.advance`."""
    p, h = plant[0], holder[0]
    follow_battery(p)
    share = motor_share(p.model.motor_time_constant, duration)
    for i in range(4):
        p.rotor_speeds[i] += share * (references[i] - p.rotor_speeds[i])
    was = p.x[5] if h.held != BENCH else 0.0
    for i in range(3):
        p.x[3 + i] = p.x[10 + i] = 0.0
    q, force_w = p.x[6:10].copy(), np.zeros(3)
    force_w[2] = GRAVITY
    if h.held != BENCH:
        phi = quaternion_log(quaternion_multiply(quaternion_conjugate(q), h.quaternion_wb))
        angle = math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
        step = TURN_RATE * duration
        if angle > step:
            for i in range(3):
                phi[i] *= step / angle
            q = quaternion_normalize(quaternion_multiply(q, quaternion_exp(phi)))
            for i in range(3):
                p.x[10 + i] = phi[i] / duration
        else:
            q = h.quaternion_wb.copy()
        for i in range(4):  # an assigned slice would take 2 s longer to compile
            p.x[6 + i] = q[i]
        up = (LIFT_HEIGHT if h.held == HAND else 0.0) - p.x[2]
        if abs(up) > AT_HEIGHT:
            most = LIFT_ACCELERATION * duration
            wanted = min(LIFT_SPEED, math.sqrt(2.0 * LIFT_ACCELERATION * abs(up)))
            change = math.copysign(wanted, up) - was
            p.x[5] = was + max(-most, min(most, change))
            p.x[2] += p.x[5] * duration
        else:
            p.x[2] += up
            if h.held == SET_DOWN and angle <= step:
                h.held = FREE
        force_w[2] += (p.x[5] - was) / duration
    felt_b = rotate_inverse(q, force_w)
    for i in range(3):
        p.specific_force_b[i] = felt_b[i]
    discharge(plant, duration)
