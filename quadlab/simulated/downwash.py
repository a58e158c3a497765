"""The air that a vehicle's rotors blow down, and its push on a vehicle beneath.

The rotors together make one jet. By momentum theory its speed, where it has contracted to half the
rotors' area, is twice that induced at the rotors: W. Johnson, "Helicopter Theory", 1980, 2.1. Below
it is a free turbulent round jet: its core keeps that speed for six diameters, then the speed on the
axis falls as 1/z, with a Gaussian profile whose half-width grows by 0.094 z: S. B. Pope, "Turbulent
Flows", 2000, 5.1. The vehicle beneath is pushed down by the drag of its frame in that air; its
rotors' loss of thrust by the inflow, and the turbulence, are left out.
"""

from __future__ import annotations

import math

from vehicle.simulator.air import ROTOR_RADIUS

AIR_DENSITY = 1.2
ROTORS_AREA = 4.0 * math.pi * ROTOR_RADIUS**2
DRAG_AREA = 0.03
"""m^2, drag coefficient times area of frame and rotors seen from above; an estimate, 1.9 N under a
hovering vehicle of 1.3 kg."""
CORE, SPREAD = 6.0, 0.094
DIAMETER = math.sqrt(2.0 * ROTORS_AREA / math.pi)
"""m, of the contracted jet."""
EDGE = 3.0
"""Half-widths from the axis at which the jet ends: 0.2 % of the speed."""


def jet_speed(thrust: float, below: float, beside: float) -> float:
    """Return the speed (m/s, downwards) of the air under rotors of this thrust (N).

    Args:
        below, beside: distances (m) from the rotors to the point.
    """
    if thrust <= 0.0 or below <= 0.0:
        return 0.0
    half_width = max(0.5 * DIAMETER, SPREAD * below)
    if beside >= EDGE * half_width:
        return 0.0
    speed = 2.0 * math.sqrt(thrust / (2.0 * AIR_DENSITY * ROTORS_AREA))
    on_axis = speed * min(1.0, CORE * DIAMETER / below)
    return on_axis * math.exp(-math.log(2.0) * (beside / half_width) ** 2)


def downward_push(speed: float) -> float:
    """Return the force (N, downwards) of air of this speed on a vehicle."""
    return 0.5 * AIR_DENSITY * DRAG_AREA * speed * speed
