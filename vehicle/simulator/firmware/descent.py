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
    slow = p.landing and climb_rate(p) > k.SETTLING_CLIMB
    if p.thrust > k.STANDING and p.unloaded == 0 and not slow:
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
    if p.unloaded == 0:
        error = bounded(-p.sink - climb, k.SINK_ERROR_MAX)
        least, most = k.LIFT_COUNT * registers[_EMERGENCY_THRUST], k.LIFT_COUNT * k.LIFT_MAX
        p.lift = min(most, max(least, p.lift + by16(error, p.gains.lift)))
        p.held = min(most, max(least, p.lift + by16(error << 6, k.CLIMB_GAIN)))
    thrust = max(0, p.held - p.unloaded) >> 12
    hold_angles(p, registers, (0, 0, 0), (thrust << 14) // max(k.COSINE_MIN, cosine))
    p.shown += by16((p.force_b[2] << 16) - p.shown, p.gains.shown)
    p.pulling += by16(p.commanded - p.pulling, p.gains.pulling)
    if p.unloaded > 0:
        _test(p)
    else:
        _presume(p, climb)
    if cosine < k.OVERTURNED:
        stop(p)


@compiled(inner=True)
def _presume(p: Item, climb: int) -> None:
    """Presume the ground where it seems to carry the vehicle, or has hit it, and begin to test it.

    A blow beyond the accelerometer's range leaves the climb rate wrong.
    """
    second = p.gains.second
    given = _given(p, max(p.pulling >> 12, k.LEAST_WEIGHT))
    learnt = ((p.support >> 16) * k.CARRIED_SHARE) >> 10
    carries = given > learnt and climb > -by16(p.sink << 1, k.SLOW_SHARE)
    p.carried = p.carried + second if carries else max(0, p.carried - second)
    pull = _pull(p)
    p.struck = min(k.BLOW_LASTS, p.struck + second)
    if p.shown - pull > k.BLOW:
        p.struck, p.try_at = 0, k.CARRIED_TIME
    is_carried = p.carried > k.CARRIED_TIME
    if is_carried or p.try_at <= p.struck < k.BLOW_LASTS:
        p.unloaded = 1
        p.began_at = pull
        p.refuted = given << 16 if is_carried else p.support
        p.carried = p.falling = p.tested = 0


@compiled(inner=True)
def _pull(p: Item) -> int:
    """Return the specific force that the thrust gives in the air, 2^-16 count."""
    return by16(by16(p.pulling, k.PULL), p.support >> 16) << 4


@compiled(inner=True)
def _test(p: Item) -> None:
    """Take thrust away: on the ground the specific force stays, in the air it falls with it."""
    second = p.gains.second
    p.unloaded = min(k.UNLOAD_MOST, p.unloaded + (by16(second, k.UNLOAD_RAMP) << 9))
    p.tested += second
    p.struck += second
    pull = _pull(p)
    falls = p.shown < ((k.SHOWN_MEAN + min(k.SHOWN_MEAN, pull)) >> 1) - k.SHOWN_MARGIN
    p.falling = p.falling + second if falls else 0
    gives_little = pull < k.PULLING_LITTLE or p.began_at - pull > k.PULLING_LESS
    rests, over = p.shown > k.SHOWN_AT_REST, p.tested > k.TEST_LONGEST
    p.carried = p.carried + second if gives_little and rests else 0
    if p.carried > k.TEST_DWELL or (over and rests):
        stop(p)
    elif p.falling > k.TEST_DWELL or over:
        p.carried = p.unloaded = 0
        p.support = p.refuted  # that much lift the air gives
        p.try_at = p.struck + k.CARRIED_TIME


@compiled(inner=True)
def begin_descent(p: Item) -> None:
    """Begin a descent from the present motion; a vehicle on the ground counts as landed.

    Just after lift-off the average thrust is still below what carries the vehicle, and the present
    one is not.
    """
    p.landing, p.landed, p.carried, p.faster, p.lasted = 1, 0, 0, 0, 0
    p.struck, p.try_at = k.BLOW_LASTS, 0
    p.lift = max(p.thrust, min(p.commanded, k.WEIGHT))
    p.sink = -climb_rate(p)
    p.unloaded, p.shown, p.pulling = 0, p.force_b[2] << 16, p.commanded
    above = min(k.HIGHEST, max(0, p.height - p.ground))
    p.longest = k.SPARE + (by16(above, k.SLOWNESS) << 3)
    p.angle_integral[0] = p.angle_integral[1] = 0
    if p.thrust < (k.STANDING if p.commanded < k.STANDING else k.STARTING):
        stop(p)


@compiled(inner=True)
def stop(p: Item) -> None:
    """Switch the motors off."""
    p.landed, p.landing, p.unloaded = 1, 0, 0
    for i in range(4):
        p.references[i] = 0
