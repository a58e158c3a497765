"""The emergency descent: level, at a climb rate held by the barometer, to the ground.

There it switches the motors off. It needs no external input. Only the attitude is controlled, not
the horizontal drift.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled
from quadrotor.records import Item
from vehicle.simulator.firmware import constants as k
from vehicle.simulator.firmware.estimation import climb_rate, vertical
from vehicle.simulator.firmware.fixed import bounded, by16
from vehicle.simulator.firmware.hovering import hold_angles
from vehicle_link.serial.ids import Id

Registers = npt.NDArray[np.int16]

_EMERGENCY_THRUST = int(Id.EMERGENCY_THRUST)


@compiled(inner=True)
def watch_thrust(p: Item) -> None:
    """Average the commanded thrust, and the specific force it gives in the air."""
    p.commanded = _commanded(p)
    p.thrust += by16(p.commanded - p.thrust, p.gains.thrust)
    if p.thrust > k.STANDING and not (p.landing and climb_rate(p) > k.SETTLING_CLIMB):
        given = _given(p, p.thrust >> 12)
        p.support += by16((given << 16) - p.support, p.gains.support)


@compiled(inner=True)
def _commanded(p: Item) -> int:
    """Return the thrust of the motors' references, 2^-24 N."""
    total = 0
    for i in range(4):
        reference = p.references[i]
        if reference > 0:
            speed = (reference << 7) + k.MOTOR_OFFSET
            total += (((speed * speed) >> 16) * k.MOTOR_SQUARE) >> 12
    return total << 12


@compiled(inner=True)
def _given(p: Item, thrust: int) -> int:
    """Return the specific force along z_B over what a thrust (2^-12 N) gives, 2^-12."""
    force: int = max(0, p.force_b[2])
    return min(k.SUPPORT_MAX, force * k.SUPPORT_UNIT // thrust)


@compiled(inner=True)
def descend(p: Item, registers: Registers) -> None:
    """Run one period of the descent of a PROGRAM; set `landed` at its end."""
    second = p.gains.second
    cosine = vertical(p)[2]
    above = p.height - p.ground
    climb = climb_rate(p)
    p.lasted += second
    if above < k.DEEPEST or p.lasted >> 4 > p.longest:
        p.faster += second >> k.FASTER_SHIFT
    wanted = p.faster + (k.SINK_FLARE if above < k.FLARE_HEIGHT else k.SINK)
    # From the initial climb rate: 2 m/s^2 while it still climbs, then 1 m/s^2.
    p.sink += bounded(wanted - p.sink, 2 * second if p.sink < 0 else second)
    error = bounded(-p.sink - climb, k.SINK_ERROR_MAX)
    least, most = k.LIFT_COUNT * registers[_EMERGENCY_THRUST], k.LIFT_COUNT * k.LIFT_MAX
    p.lift = min(most, max(least, p.lift + by16(error, p.gains.lift)))
    thrust = min(most, max(least, p.lift + by16(error << 6, k.CLIMB_GAIN))) >> 12
    hold_angles(p, registers, (0, 0, 0), (thrust << 14) // max(k.COSINE_MIN, cosine))
    # The average is too low just after lift-off.
    given = _given(p, max(max(p.thrust, p.commanded) >> 12, k.LEAST_WEIGHT))
    learnt = ((p.support >> 16) * k.CARRIED_SHARE) >> 10
    carries = given > learnt and climb > -by16(p.sink << 1, k.SLOW_SHARE)
    p.carried = p.carried + second if carries else max(0, p.carried - second)
    if p.carried > k.CARRIED_TIME or cosine < k.OVERTURNED:
        stop(p)


@compiled(inner=True)
def begin_descent(p: Item) -> None:
    """Begin a descent from the present motion; a vehicle on the ground counts as landed.

    Just after lift-off the average thrust is still below what carries the vehicle, and the present
    one is not.
    """
    p.landing, p.landed, p.carried, p.faster, p.lasted = 1, 0, 0, 0, 0
    p.lift = max(p.thrust, min(p.commanded, k.WEIGHT))
    p.sink = -climb_rate(p)
    above = min(k.HIGHEST, max(0, p.height - p.ground))
    p.longest = k.SPARE + (by16(above, k.SLOWNESS) << 3)
    p.angle_integral[0] = p.angle_integral[1] = 0
    if p.thrust < (k.STANDING if p.commanded < k.STANDING else k.STARTING):
        stop(p)


@compiled(inner=True)
def stop(p: Item) -> None:
    """Switch the motors off."""
    p.landed, p.landing = 1, 0
    for i in range(4):
        p.references[i] = 0
