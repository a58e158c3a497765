"""The battery: four lithium-polymer cells, drained by rotors and avionics.

Records `p` are items of PLANT (vehicle.simulator.plant).
"""

from __future__ import annotations

import math

from quadrotor.compiled import compiled
from quadrotor.records import Item, Record
from quadrotor.rigid_body import rotor_thrust

CELLS = 4
CELL_CURVE = (3.0, 3.68, 3.74, 3.77, 3.79, 3.82, 3.87, 3.92, 3.98, 4.06, 4.2)
"""Voltage of one lithium-polymer cell without load, at each tenth of its charge: a long plateau
between two steep ends, so that the last tenth is used up quickly."""
AVIONICS_POWER = 8.0
"""Power of the avionics, in W."""
POWER_PER_THRUST = 1.0 / (0.37 * math.sqrt(2.0 * 1.2 * math.pi * 0.127**2))
"""Power per thrust, in W per N^1.5: ideal hover power of a 0.254 m propeller (Sec. 2) at 37 %
overall efficiency, which gives the paper's endurance of around 10 min."""


def charge_battery(plant: Record, share: float) -> None:
    """Set the battery's charge to a share (0..1) of its capacity."""
    plant["charge"] = share * plant["capacity"]
    plant["voltage"] = open_voltage(share)


@compiled
def open_voltage(charge: float) -> float:
    """Return the battery's voltage (V) without load, at a share (0..1) of its charge."""
    tenths = 10.0 * min(1.0, max(0.0, charge))
    below = min(9, int(tenths))
    low, high = CELL_CURVE[below], CELL_CURVE[below + 1]
    return CELLS * (low + (tenths - below) * (high - low))


@compiled(inner=True)
def follow_battery(p: Item) -> None:
    """Update the thrust for the battery: it is proportional to the square of the voltage."""
    if p.battery_exponent > 0.0:
        voltage = min(1.5, max(0.5, p.voltage / p.battery_nominal))
        p.battery_share = voltage ** (2.0 * p.battery_exponent)


@compiled(inner=True)
def discharge(plant: Record, duration: float) -> None:
    """Draw the rotors' and the avionics' power; the terminals sag by the inner resistance."""
    p = plant[0]
    power = AVIONICS_POWER
    for i in range(4):
        f = rotor_thrust(p.rotor_speeds[i], p.model.motor_slope, p.model.motor_offset)
        power += POWER_PER_THRUST * f * math.sqrt(f)
    current = power / max(p.voltage, 1.0)
    p.charge = max(0.0, p.charge - current * duration)
    p.voltage = max(0.0, open_voltage(p.charge / p.capacity) - p.resistance * current)
