"""The firmware's estimates: the attitude, and the height with the climb rate.

The attitude filter is Mahony's passive filter with gyroscope drift, of the vertical.
R. Mahony, T. Hamel, J.-M. Pflimlin, "Nonlinear complementary filters on the special orthogonal
group", 2008, in its explicit form with gravity as the only direction. That gives no heading, and
none is needed here: the filter estimates the vertical in body axes, `up_b`. In flight the
accelerometer measures thrust and drag, not gravity: the correction is slow then, and fast with
motors off.

The height and climb rate are those of an observer with three equal poles. The barometer alone,
0.2 m of noise a sample, gives a climb rate only over seconds; the accelerometer alone drifts. The
third state is the bias of the vertical specific force. A vehicle that rests does not climb, so its
climb rate is zero then, and the mean of the vertical specific force is the bias: a barometer's
noise would give a climb rate that is wrong at lift-off.

A room's pressure changes when a door opens, and a damaged barometer drifts. So a second observer
follows the accelerometer, and the first only slowly. While the two climb rates differ by more than
sensors do, the barometer is doubted: the accelerometer's climb rate counts, and the ground's height
moves with the pressure.
"""

from __future__ import annotations

from quadrotor.compiled import compiled
from quadrotor.records import Item
from vehicle.simulator.firmware import constants as k
from vehicle.simulator.firmware.fixed import angle_of, bounded, by16, root

Whole = tuple[int, int, int]
"""Vector of whole numbers."""


@compiled(inner=True)
def estimate_attitude(p: Item, omega_b: Whole, force_b: Whole) -> None:
    """Update the estimate of a PROGRAM for one period.

    Args:
        omega_b: raw angular velocity, counts.
        force_b: raw specific force, counts.
    """
    g, drift, rate = p.gains, p.drift, p.rate_b
    still = not p.turning
    for i in range(3):
        rate[i] = (omega_b[i] << 16) - (drift[i] >> 8)
        p.force_b[i] = force_b[i]
        still = still and -k.STILL < rate[i] < k.STILL
    if still:
        for i in range(3):
            drift[i] = bounded(drift[i] + by16(rate[i] << 2, g.rest), k.DRIFT_MAX)
            rate[i] = (omega_b[i] << 16) - (drift[i] >> 8)
    up = vertical(p)
    c = _correction(force_b, up)
    gain = k.CORRECTION_RESTING
    if p.turning:
        turned = c[0] * c[0] + c[1] * c[1] + c[2] * c[2] >= k.TURNED_SQUARE
        gain = k.CORRECTION_TURNED if turned else k.CORRECTION_FLYING
        learnt = g.drift_turned if turned else g.drift
        for i in range(3):
            drift[i] = bounded(drift[i] - ((c[i] * learnt + 0x2000) >> 14), k.DRIFT_MAX)
    x = by16(rate[0] + ((c[0] * gain) >> 4), g.turn) << 2  # 2^-32 rad
    y = by16(rate[1] + ((c[1] * gain) >> 4), g.turn) << 2
    z = by16(rate[2] + ((c[2] * gain) >> 4), g.turn) << 2
    # up x (x, y, z), then renormalised by one step of Newton's method.
    u = p.up_b
    u[0] += by16(z, up[1]) - by16(y, up[2])
    u[1] += by16(x, up[2]) - by16(z, up[0])
    u[2] += by16(y, up[0]) - by16(x, up[1])
    up = vertical(p)
    short = ((1 << 28) - (up[0] * up[0] + up[1] * up[1] + up[2] * up[2])) >> 13
    for i in range(3):
        u[i] += by16(u[i], short)
    up = vertical(p)
    p.roll = angle_of(up[1], up[2])
    p.pitch = -angle_of(up[0], root(up[1] * up[1] + up[2] * up[2]))


@compiled(inner=True)
def vertical(p: Item) -> Whole:
    """Return the world's z axis in body axes, 2^-14; its third number is the tilt's cosine."""
    return p.up_b[0] >> 16, p.up_b[1] >> 16, p.up_b[2] >> 16


@compiled(inner=True)
def _correction(force_b: Whole, up: Whole) -> Whole:
    """Return the rotation vector (2^-14 rad) from the vertical to the force's direction."""
    x, y, z = force_b
    square = x * x + y * y + z * z
    if not k.FORCE_SQUARE_MIN < square < k.FORCE_SQUARE_MAX:
        return 0, 0, 0
    inverse = k.INVERSE_NEAR - by16(square, k.INVERSE_SLOPE)
    return (
        _scaled(y * up[2] - z * up[1], inverse),
        _scaled(z * up[0] - x * up[2], inverse),
        _scaled(x * up[1] - y * up[0], inverse),
    )


@compiled(inner=True)
def _scaled(product: int, inverse: int) -> int:
    return (((product + 0x80) >> 8) * inverse + 0x2000) >> 14


@compiled(inner=True)
def estimate_climb(p: Item, barometer: int) -> None:
    """Update height and climb rate of a PROGRAM for one period, after its attitude.

    Args:
        barometer: height (2^-18 m).
    """
    if not p.awake:
        p.height = barometer
    g, f, up = p.gains, p.force_b, vertical(p)
    force = up[0] * f[0] + up[1] * f[1] + up[2] * f[2] - k.GRAVITY_COUNTS
    light = p.thrust < k.STANDING and p.commanded < k.STANDING
    if not p.turning or (light and -k.SHAKING < force < k.SHAKING):
        _rest(p, force, barometer)
        return
    climb = p.climb + by16(force - (p.climb_bias >> 8), g.up)
    height = p.height + ((by16(climb, g.second) + 0x200) >> 10)
    error = bounded(barometer - height, k.HEIGHT_ERROR_MAX)
    p.height = height + by16(error, g.height)
    p.climb = bounded(climb + by16(error << 3, g.climb), k.CLIMB_MAX)
    p.climb_bias = bounded(p.climb_bias - by16(error << 8, g.bias), k.CLIMB_BIAS_MAX)
    _doubt(p, force)


@compiled(inner=True)
def _rest(p: Item, force: int, barometer: int) -> None:
    """Hold the climb rate at 0; learn the bias of the vertical force (2^-14 count)."""
    g = p.gains
    off = bounded(force - (p.climb_bias >> 8), k.SHAKING)
    p.climb_bias = bounded(p.climb_bias + by16(off << 8, g.bias_resting), k.CLIMB_BIAS_MAX)
    error = bounded(barometer - p.height, k.HEIGHT_ERROR_MAX)
    p.height += by16(error, g.height_resting)
    p.climb = p.felt_climb = p.doubted = 0
    p.felt_bias = p.climb_bias
    if not p.turning:
        p.ground = p.height


@compiled(inner=True)
def _doubt(p: Item, force: int) -> None:
    """Update the accelerometer's climb rate by the vertical force (2^-14 count), and the doubt."""
    g = p.gains
    felt = p.felt_climb + by16(force - (p.felt_bias >> 8), g.up)
    off = bounded(p.climb - felt, k.DOUBT_MAX)
    if p.doubted <= k.DOUBT_TIME:
        felt += by16(off, g.felt)
        bias = p.felt_bias - by16(off, g.felt_bias)
        p.felt_bias = bounded(bias, k.CLIMB_BIAS_MAX)
    else:
        p.ground += (by16(off, g.second) + 0x200) >> 10
        if not p.landing:
            felt -= by16(felt, g.felt)  # in a room no climb lasts
    if p.landing and p.force_b[2] > k.SHOCK:
        felt = 0
    p.felt_climb = bounded(felt, k.CLIMB_MAX)
    if -k.DOUBT < off < k.DOUBT:
        p.doubted = max(0, p.doubted - g.second)
        return
    p.doubted += g.second
    if p.doubted > k.DOUBT_TIME:
        p.doubted = k.DOUBT_LASTS


@compiled(inner=True)
def climb_rate(p: Item) -> int:
    """Return the climb rate, 2^-22 m/s: by the barometer unless it is doubted."""
    felt: int = p.felt_climb
    climb: int = p.climb
    return felt if p.doubted > k.DOUBT_TIME else climb
