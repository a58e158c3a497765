"""The tracker's poses against the inertial sensors, independently of any estimator.

Between two poses the IMU says how the body turned and how it was accelerated. Both sides pass
through the same high-pass filters, of first order for the turn (`TURN_TIME`) and of second order
for the displacement (`PLACE_RATE`), so that an unknown start does not matter: `t` is what is left
of the tracker's motion, `g` what is left of the IMU's. A bias of the IMU adds a constant to g, the
mean of g - t, which is taken off. Then both are equal but for noise if the tracker is right.

The evidence against the tracker is the logarithm of the likelihood that t has nothing to do with g
over that it equals g, the sum of (|g|² - 2 t·g) / 2σ², kept between 0 and a limit (CUSUM: Page,
Biometrika 1954). Axes that are reversed or permuted leave |t| as large as |g|, and add to it with
every motion; a true pose takes away. A share of the motion counts as noise, because small errors of
axes, scales and stamps are no reason to stop flying; a turn that may be the gyroscope's noise alone
is no evidence, nor is a motion that the tracker alone shows: it is judged by the gate.

The mean of g - t for the displacement is an acceleration that the tracker does not show. Its
horizontal part is the angle between the verticals of tracker and accelerometer, times g.

The slope of g over t, which has less noise, is the inverse of the scale of positions. Stamps that
are late make t late: t - g is minus that time the rate of the turn, and the slope of the one over
the other is the time.

The functions take one INTEGRITY_MEMORY record m.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from quadrotor.compiled import compiled
from quadrotor.constants import GRAVITY
from quadrotor.records import IMU_SAMPLE, Record
from quadrotor.vectors import (
    Quaternion,
    Vector,
    add,
    along,
    axes_of,
    dot,
    length,
    multiply,
    quaternion,
    scale,
    store,
    subtract,
    to_world,
    turned,
    vector,
)

RING_LENGTH = 512
"""Number of IMU samples kept for delayed poses: 1.02 s at 500 Hz."""
LONGEST_GAP = 0.3
"""Longest time, in s, between two poses that are compared."""
TURN_TIME = 1.0
"""Time constant, in s, of the high-pass of turns."""
PLACE_RATE = 3.0
"""Double pole, in rad/s, of the high-pass of displacements."""
OUTLIERS = 0.15
"""Time, in s, after which poses that are outliers have jumped: the filters begin there."""
SETTLING = 1.0
"""Time, in s, in which the filters forget their first start and nothing is judged."""
KNOWN, FITTED = 0.5, 8.0
"""Times, in s, after which the means and the slopes are known, the latter without doubt."""
UNKNOWN = 0.03
"""Deviation, in m, of a displacement after another start, when velocity and vertical may be wrong;
it decays in `MOTION_TIME`."""
OFFSET_TIME = 1.5
"""Time constant, in s, of the means of g - t, which begin with a plain mean."""
SLOPE_TIME = 8.0
"""Time constant, in s, of the slopes that give scale and lateness: a lap of the 8."""
LEAST_RATE, LEAST_MOTION = 0.1, 0.06
"""Rates (rad/s, rms) and displacements (m, rms) from which on the slopes are known."""
NOISE_TIME = 4.0
"""Time constant, in s, of the variances of the differences, which begin with a plain mean."""
CORRELATION = 0.05
"""Time, in s, within which the errors of displacements are alike."""
MOTION_TIME = 1.0
"""Time constant, in s, of the mean square motion."""
LEAST_TURN, LEAST_PLACE = math.radians(0.1), 0.003
"""Least deviations of the differences, rad and m."""
FELT_TURN = math.radians(0.3)
"""Turn, rad rms, that may be the noise of the gyroscope alone, which adds up within `TURN_TIME`: at
rest it is up to 0.1 deg."""
START_TURN, START_PLACE = math.radians(1.0), 0.01
"""Deviations before any difference is known, rad and m."""
ERROR = 0.2
"""Share of the motion that counts as noise."""
SKEW = 0.25
"""Share of the motion along all axes in those errors of the motion along two."""
OUTLIER, JUMP = 8.0, 6.0
"""Deviations beyond twice the motion from which on a pose is an outlier, which shows nothing: by
the filters, and by the turn since the last pose."""
VISIBLE = 3.0
"""Deviations that noise may add to a motion."""
USUAL_INTERVAL = 0.02
"""Time, in s, between two poses, for which the turn since the last pose counts."""
SMALLER, LARGER = 0.5, 1.3
"""Bounds of |t| over |g| for evidence against the tracker."""
MOST = 20.0
"""Largest evidence."""
DOUBTED = 10.0
"""Evidence from which on nothing is learnt from the poses, …"""
LONG_DOUBTED = 5.0
"""… for this time, in s: what was learnt before may be that of a lie, as what is learnt later."""
SLOWEST, FASTEST = 10.0, 250.0
"""Changes of the evidence, 1/s: smaller ones are noise on a mean that is not exact, and count as
none; larger ones count as this, because one pose alone shows nothing."""
CLIPPED_FORCE, CLIPPED_RATE = 19.0, 5.0
"""Specific force (m/s²) and rate (rad/s) near the limits of the paper's sensors, ± 2 g and
± 300 deg/s, beyond which a sample shows nothing."""

TURN, TILT, PLACE, LEVEL = range(4)
"""The tests: by the turn about all axes of the body, and about x and y alone; by the displacement
along all axes of the world, and along x and y alone."""

INTEGRITY_MEMORY = np.dtype(
    [
        ("ring", IMU_SAMPLE, RING_LENGTH),
        ("ring_next", "i8"),  # number of samples so far
        ("stamp_ns", "i8"),  # of the newest pose compared, 0 before the first
        ("settled", "f8"),  # s since the start of the filters
        ("learnt", "f8"),  # s for which means and variances were learnt
        ("doubted", "f8"),  # s for which the evidence has been large
        ("quaternion_wb", "f8", 4),  # of the newest pose
        ("turn_shown_b", "f8", 3),  # rad, memory of the high-pass of the tracker
        ("turn_felt_b", "f8", 3),  # rad, the same of the IMU
        ("place_shown_w", "f8", 6),  # m and m/s
        ("place_felt_w", "f8", 6),
        ("turn_offset_b", "f8", 3),  # rad, mean of g - t
        ("place_offset_w", "f8", 3),  # m
        ("turn_variance", "f8"),  # rad², of a difference on one axis
        ("place_variance", "f8"),  # m²
        ("motion", "f8", 4),  # rad² or m², mean of |g|², by the test
        ("evidence", "f8", 4),  # by the test
        ("fitted", "f8"),  # s, for which the slopes were fitted
        ("late", "f8", 2),  # rad², means of (g - t)·rate, in s, and of |rate|², in 1/s²
        ("size", "f8", 2),  # m², means of |t|² and of t·g
        ("size_offset_h", "f8", 3),  # m, mean of g - t along the heading, for these
    ],
    align=True,
)


def new_integrity() -> Record:
    """Return INTEGRITY_MEMORY (1,) before the first sample."""
    m = np.zeros(1, INTEGRITY_MEMORY)
    m["turn_variance"], m["place_variance"] = START_TURN**2, START_PLACE**2
    return m


@compiled(inner=True)
def errors_of(m: Any) -> tuple[float, float, float]:
    """Return the angle (rad) between the verticals, the time (s) by which stamps are too late, and
    the share by which positions are too large; each 0 while it is not known.
    """
    tilt = late = size = 0.0
    if m.learnt > KNOWN:
        tilt = PLACE_RATE**2 * math.hypot(m.place_offset_w[0], m.place_offset_w[1]) / GRAVITY
    if m.fitted > FITTED and m.late[1] > LEAST_RATE**2:
        late = m.late[0] / m.late[1]
    if m.fitted > FITTED and m.size[1] > LEAST_MOTION**2:
        size = m.size[0] / m.size[1] - 1.0
    return tilt, late, size


@compiled
def errors(memory: Record) -> tuple[float, float, float]:
    """Return `errors_of` an INTEGRITY_MEMORY (1,)."""
    return errors_of(memory[0])


@compiled
def note_sample(memory: Record, imu: Record) -> None:
    """Store an IMU_SAMPLE (1,) in INTEGRITY_MEMORY (1,)."""
    m, s = memory[0], imu[0]
    kept = m.ring[m.ring_next % RING_LENGTH]
    kept.stamp_ns = s.stamp_ns
    for i in range(3):
        kept.specific_force_b[i] = s.specific_force_b[i]
        kept.angular_velocity_b[i] = s.angular_velocity_b[i]
    m.ring_next += 1


@compiled
def compare_pose(memory: Record, pose: Record, state: Record) -> float:
    """Compare a POSE_SAMPLE (1,) that has an attitude with the samples since the last one.

    Args:
        memory: INTEGRITY_MEMORY (1,).
        state: STATE (1,), whose velocity begins the filters.

    Returns the largest evidence, or -1 for a pose that was not judged.
    """
    m, z = memory[0], pose[0]
    since = 1e-9 * (z.stamp_ns - m.stamp_ns)
    if m.stamp_ns > 0 and since > -LONGEST_GAP and since <= 0.0:
        return -1.0
    if m.stamp_ns > 0 and since > 0.0 and since < LONGEST_GAP:
        felt, turn_b, velocity_w, place_w = _felt(m, z.stamp_ns)
        if felt and _take(m, z, since, turn_b, velocity_w, place_w):
            e = m.evidence
            return max(e[0], e[1], e[2], e[3]) if m.learnt > KNOWN else -1.0
        if felt and since < OUTLIERS:
            return -1.0
    _start(m, z, state[0])
    return -1.0


@compiled(inner=True)
def _start(m: Any, z: Any, state: Any) -> None:
    """Start the filters at this pose, in the state that a constant error of g leads to."""
    m.settled = 0.0
    for i in range(3):
        offset = m.place_offset_w[i]
        m.turn_shown_b[i] = 0.0
        m.turn_felt_b[i] = m.turn_offset_b[i]
        m.place_felt_w[i] = m.place_felt_w[3 + i] = 0.0
        m.place_shown_w[i] = z.position_w[i] + offset
        m.place_shown_w[3 + i] = state.velocity_w[i] + 2.0 * PLACE_RATE * offset
    _keep(m, z)


@compiled(inner=True)
def _keep(m: Any, z: Any) -> None:
    m.stamp_ns = z.stamp_ns
    for i in range(4):
        m.quaternion_wb[i] = z.quaternion_wb[i]


@compiled(inner=True)
def _felt(m: Any, stamp_ns: int) -> tuple[bool, Vector, Vector, Vector]:
    """Return what the IMU says about the time from the last pose to this stamp: whether it can,
    the turn (rad, body axes), the change of velocity (m/s) and the displacement that comes from it
    (m), in world axes by the last pose's attitude.
    """
    turn_b, velocity_w, place_w = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    first, oldest = m.ring_next, max(0, m.ring_next - RING_LENGTH)
    while first > oldest and m.ring[(first - 1) % RING_LENGTH].stamp_ns > m.stamp_ns:
        first -= 1
    if first == oldest:  # the samples begin after the last pose
        return False, turn_b, velocity_w, place_w
    q, now_ns = quaternion(m.quaternion_wb), m.stamp_ns
    for k in range(first, m.ring_next + 1):
        is_newest = k == m.ring_next  # it holds until the pose
        s = m.ring[(k - 1 if is_newest else k) % RING_LENGTH]
        until_ns = stamp_ns if is_newest else min(s.stamp_ns, stamp_ns)
        dt = 1e-9 * (until_ns - now_ns)
        if dt <= 0.0:
            break
        rate_b, force_b = vector(s.angular_velocity_b), vector(s.specific_force_b)
        for i in range(3):
            if not (abs(force_b[i]) < CLIPPED_FORCE and abs(rate_b[i]) < CLIPPED_RATE):
                return False, turn_b, velocity_w, place_w
        x, y, z = to_world(axes_of(q), force_b)
        acceleration_w = x, y, z - GRAVITY
        place_w = along(along(place_w, dt, velocity_w), 0.5 * dt * dt, acceleration_w)
        velocity_w = along(velocity_w, dt, acceleration_w)
        turn_b = along(turn_b, dt, rate_b)
        q, now_ns = turned(q, scale(dt, rate_b)), until_ns
    return True, turn_b, velocity_w, place_w


@compiled(inner=True)
def _take(
    m: Any, z: Any, since: float, turn_b: Vector, velocity_w: Vector, place_w: Vector
) -> bool:
    """Step the filters by one pose and judge it; return False, without doing so, for an outlier.

    The filters are observers with fixed poles, split into what their two inputs give: the poses,
    and what the IMU felt.
    """
    shown = _turn(quaternion(m.quaternion_wb), quaternion(z.quaternion_wb))
    shown_b, felt_b = add(vector(m.turn_shown_b), shown), add(vector(m.turn_felt_b), turn_b)
    expected_w = along(vector(m.place_shown_w), since, vector(m.place_shown_w[3:]))
    shown_w = subtract(vector(z.position_w), expected_w)
    felt_w = add(along(vector(m.place_felt_w), since, vector(m.place_felt_w[3:])), place_w)
    g_b = subtract(felt_b, vector(m.turn_offset_b))
    g_w = subtract(felt_w, vector(m.place_offset_w))
    is_settled = m.learnt > 0.0 or m.settled >= SETTLING
    if is_settled and (
        _has_jumped(m, since, shown, turn_b)
        or _is_outlier(shown_b, g_b, m.turn_variance)
        or _is_outlier(shown_w, g_w, m.place_variance + _unknown(m))
    ):
        return False
    m.settled += since
    _keep(m, z)
    left = max(0.0, 1.0 - since / min(TURN_TIME, m.settled))  # at first the mean since the start
    store(scale(left, shown_b), m.turn_shown_b)
    store(scale(left, felt_b), m.turn_felt_b)
    pole = math.exp(-PLACE_RATE * since)
    gain, speed_gain = 1.0 - pole * pole, (1.0 - pole) ** 2 / since
    for i in range(3):
        m.place_shown_w[i] = expected_w[i] + gain * shown_w[i]
        m.place_shown_w[3 + i] += speed_gain * shown_w[i]
        m.place_felt_w[i] = (1.0 - gain) * felt_w[i]
        m.place_felt_w[3 + i] += velocity_w[i] - speed_gain * felt_w[i]
    if is_settled:
        _judge(m, since, shown_b, g_b, shown_w, g_w)
        rate_b = subtract(scale(1.0 / since, turn_b), scale(1.0 / TURN_TIME, g_b))
        _fit(m, since, subtract(g_b, shown_b), rate_b, shown_w, felt_w)
    return True


@compiled(inner=True)
def _unknown(m: Any) -> float:
    """Return the variance, in m², of a displacement by an unknown start."""
    return UNKNOWN**2 * math.exp(-2.0 * m.settled / MOTION_TIME)


@compiled(inner=True)
def _has_jumped(m: Any, since: float, shown_b: Vector, felt_b: Vector) -> bool:
    """Return whether the attitude changed by more than noise and a lie about the rate."""
    felt = length(felt_b) * min(1.0, USUAL_INTERVAL / since)
    far = length(subtract(shown_b, felt_b))
    return not far < 2.0 * felt + JUMP * math.sqrt(m.turn_variance)


@compiled(inner=True)
def _is_outlier(t: Vector, g: Vector, variance: float) -> bool:
    far = length(subtract(t, g))
    return not far < 2.0 * length(g) + OUTLIER * math.sqrt(variance)


@compiled(inner=True)
def _judge(m: Any, since: float, t_b: Vector, g_b: Vector, t_w: Vector, g_w: Vector) -> None:
    """Add to the evidence, and learn from the differences."""
    _weigh(m, TURN, t_b, g_b, since)
    _weigh(m, TILT, _level(t_b), _level(g_b), since)
    _weigh(m, PLACE, t_w, g_w, since)
    _weigh(m, LEVEL, _level(t_w), _level(g_w), since)
    m.learnt += since
    e = m.evidence
    if max(e[0], e[1], e[2], e[3]) > DOUBTED:
        m.doubted += since
        m.fitted = m.late[0] = m.late[1] = m.size[0] = m.size[1] = 0.0
        if m.doubted < LONG_DOUBTED:
            return
    else:
        if m.doubted > LONG_DOUBTED:
            m.learnt = since
        m.doubted = 0.0
    difference_b, difference_w = subtract(g_b, t_b), subtract(g_w, t_w)
    share = min(1.0, since / min(m.learnt, NOISE_TIME))
    m.turn_variance = _learnt(m.turn_variance, difference_b, share, LEAST_TURN)
    m.place_variance = _learnt(m.place_variance, difference_w, share, LEAST_PLACE)
    share = min(1.0, since / min(m.learnt, OFFSET_TIME))
    for i in range(3):
        m.place_offset_w[i] += share * difference_w[i]
    share = min(1.0, since / min(m.learnt, SLOPE_TIME))
    for i in range(3):
        m.turn_offset_b[i] += share * difference_b[i]


@compiled(inner=True)
def _fit(m: Any, since: float, late_b: Vector, rate_b: Vector, t_w: Vector, felt_w: Vector) -> None:
    """Add one pose to the slopes.

    A bias turns with the body, so what it adds to the displacement is constant along the heading.
    """
    x_b = axes_of(quaternion(m.quaternion_wb))[0]
    norm = math.hypot(x_b[0], x_b[1])
    c, s = (x_b[0] / norm, x_b[1] / norm) if norm > 0.1 else (1.0, 0.0)
    o, off_w = m.size_offset_h, subtract(felt_w, t_w)
    share = min(1.0, since / min(m.learnt, SLOPE_TIME))
    o[0] += share * (c * off_w[0] + s * off_w[1] - o[0])
    o[1] += share * (c * off_w[1] - s * off_w[0] - o[1])
    o[2] += share * (off_w[2] - o[2])
    g_w = subtract(felt_w, (c * o[0] - s * o[1], s * o[0] + c * o[1], o[2]))
    if length(subtract(g_w, t_w)) > SMALLER * length(g_w) + OUTLIER * LEAST_PLACE:
        return
    m.fitted += since
    share = min(1.0, since / SLOPE_TIME)
    m.late[0] += share * (dot(late_b, rate_b) - m.late[0])
    m.late[1] += share * (dot(rate_b, rate_b) - m.late[1])
    m.size[0] += share * (dot(t_w, t_w) - m.size[0])
    m.size[1] += share * (dot(t_w, g_w) - m.size[1])


@compiled(inner=True)
def _level(v: Vector) -> Vector:
    return v[0], v[1], 0.0


@compiled(inner=True)
def _weigh(m: Any, test: int, t: Vector, g: Vector, since: float) -> None:
    """Add to the evidence of one test, once the means are known."""
    shown, felt = length(t), length(g)
    m.motion[test] += min(1.0, since / MOTION_TIME) * (felt * felt - m.motion[test])
    if m.learnt < KNOWN:
        return
    of_turn = test < PLACE
    variance = m.turn_variance if of_turn else m.place_variance
    offset = length(vector(m.turn_offset_b)) if of_turn else length(vector(m.place_offset_w))
    every = m.motion[TURN if of_turn else PLACE]
    errors = max(m.motion[test], felt * felt) + SKEW**2 * every + offset * offset
    uncertain = variance + ERROR**2 * errors
    if not of_turn:
        uncertain = (uncertain + _unknown(m)) * max(1.0, CORRELATION / since)
    found = 0.5 * (felt * felt - 2.0 * dot(t, g)) / uncertain
    if of_turn:
        found *= max(0.0, 1.0 - FELT_TURN**2 / max(m.motion[test], FELT_TURN**2))
    if found > 0.0 and not (SMALLER * felt < shown < LARGER * felt + VISIBLE * math.sqrt(variance)):
        return
    size = min(max(0.0, abs(found) - SLOWEST * since), FASTEST * since)
    m.evidence[test] = max(0.0, min(m.evidence[test] + math.copysign(size, found), MOST))


@compiled(inner=True)
def _learnt(variance: float, difference: Vector, share: float, least: float) -> float:
    square = min(dot(difference, difference) / 3.0, 9.0 * variance)
    return max(variance + share * (square - variance), least * least)


@compiled(inner=True)
def _turn(before: Quaternion, now: Quaternion) -> Vector:
    """Return the rotation vector (rad, body axes) from one attitude to the next."""
    w, x, y, z = before
    dw, dx, dy, dz = multiply((w, -x, -y, -z), now)
    s = length((dx, dy, dz))
    k = 2.0 if s < 1e-9 else 2.0 * math.atan2(s, abs(dw)) / s
    if dw < 0.0:
        k = -k
    return k * dx, k * dy, k * dz
