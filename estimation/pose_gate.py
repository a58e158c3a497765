"""The gate for poses of the complementary filter, and its recovery after refusing true poses.

A pose passes when its position and its attitude are within `pose_gate` deviations of the filter's
prediction for its stamp. The variance is the filter's own: the running median of the squared
innovations, at least the stated noise, and the possible error of a prediction without poses. The
median counts refused poses too, so that growing noise opens the gate, while outliers do not if they
are less than half of the poses.

An outlier appears at once. Poses that leave the prediction little by little pass, however far they
get: the estimate drifts, as after a hard knock, and needs them.

Refused poses are compared with each other. A run of them that agree shows that the tracker jumped
or, when none had arrived for a while before, that the estimate drifted. After `JUMP_WAIT` or
`DRIFT_WAIT` the estimate is moved to the run, in position, velocity and attitude, without the kick
that so large an innovation causes through the gains.

The functions take one ESTIMATOR_MEMORY record m and one ESTIMATION_GAINS record g.
"""

from __future__ import annotations

import math

from estimation.attitude_filter import Triple
from estimation.history import amend
from estimation.outcome import Agreement
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Quaternion, dot, length, multiply, quaternion, scale, subtract, vector

JUMP_WAIT, DRIFT_WAIT = 0.5, 0.2
"""Seconds after which the estimate is moved to poses that agree with each other but not with it."""
JUMP_INTERVAL = 0.25
"""Seconds without poses beyond which the estimate may have drifted."""
GROWTH = 1.0
"""Largest change of the innovation from one pose to the next by a drift, as a share of the last."""
RUN_LEAST = 3
"""Number of poses that must agree; fewer may be chance."""
RUN_GAP = 0.5
"""Longest time, in s, between two poses of a run."""
RUN_SPEED, RUN_RATE = 3.0, 1.0
"""Fastest motion, m/s and rad/s, of a drifting estimate relative to the poses."""
DRIFT_SPEED, DRIFT_ACCELERATION, DRIFT_RATE = 0.05, 0.1, 0.02
"""Deviations of a prediction without poses, m/s, m/s^2, rad/s."""
MEDIAN = 2.366
"""Median of the sum of three squares of unit variance."""
PACE, PACE_RATE = 0.1, 10.0
"""Largest change of a running median, as a share per pose and per second."""
LARGEST = 1.0
"""Largest variance, m^2 and rad^2."""

_USED, _REFUSED, _JUMPED, _DRIFTED, _MOVED = (int(a) for a in Agreement)


@compiled(inner=True)
def distance(m: Item, stamp_ns: int, square: float, turn2: float, g: Item) -> float:
    """Return the squared distance of a pose from its prediction in variances, the larger of
    position and attitude.

    Args:
        square: m^2, of the position.
        turn2: rad^2, of the attitude.
    """
    # During a run, its poses must not pass because of the time for which they were refused.
    until_ns = m.run_start_ns if m.run_count > 0 else stamp_ns
    t = max(0.0, 1e-9 * (until_ns - m.pose_stamp_ns))
    missed = t * (DRIFT_SPEED + 0.5 * t * DRIFT_ACCELERATION)
    position = square / (max(m.position_scale, g.pose_position_noise**2) + missed * missed)
    attitude = turn2 / (max(m.attitude_scale, g.pose_attitude_noise**2) + (DRIFT_RATE * t) ** 2)
    far: float = max(position, attitude) + 0.0 * (square + turn2)  # NaN stays NaN
    return far


@compiled(inner=True)
def adapt(m: Item, stamp_ns: int, square: float, turn2: float, g: Item) -> None:
    """Move the running medians towards the squares of one innovation."""
    pace = 1.0 + min(PACE, PACE_RATE * 1e-9 * (stamp_ns - m.newest_ns))
    m.position_scale = _moved(m.position_scale, square, pace, g.pose_position_noise)
    m.attitude_scale = _moved(m.attitude_scale, turn2, pace, g.pose_attitude_noise)


@compiled(inner=True)
def _moved(variance: float, square: float, pace: float, noise: float) -> float:
    wider = square > MEDIAN * variance
    variance = variance * pace if wider else variance / pace
    return max(noise * noise, min(variance, LARGEST))


@compiled(inner=True)
def passes(m: Item, stamp_ns: int, offset_w: Triple, turn2: float, g: Item) -> bool:
    """Return whether a pose may be used; if so, the gate adapts to it.

    Args:
        offset_w: m, from the prediction.
        turn2: rad^2, of the attitude.
    """
    square = dot(offset_w, offset_w)
    far = distance(m, stamp_ns, square, turn2, g)
    near = far < g.pose_gate * g.pose_gate
    if not (near or _drifts(m, stamp_ns, offset_w, turn2, g)):
        return False
    adapt(m, stamp_ns, square, turn2, g)
    m.distance, m.last_turn = far, math.sqrt(turn2)
    for i in range(3):
        m.last_offset_w[i] = offset_w[i]
    m.run_count, m.agreement = 0, _USED if near else _DRIFTED
    return True


@compiled(inner=True)
def _drifts(m: Item, stamp_ns: int, offset_w: Triple, turn2: float, g: Item) -> bool:
    """Return whether a pose beyond the gate continues one that was just used."""
    if m.pose_stamp_ns != m.newest_ns or 1e-9 * (stamp_ns - m.pose_stamp_ns) > JUMP_INTERVAL:
        return False
    near, level = _reach(m, g)
    last = vector(m.last_offset_w)
    change = subtract(offset_w, last)
    near, level = near + GROWTH * length(last), level + (1.0 + GROWTH) * m.last_turn
    return dot(change, change) < near * near and turn2 < level * level


@compiled(inner=True)
def _reach(m: Item, g: Item) -> tuple[float, float]:
    """Return the width of the gate (m, rad) just after a pose was used."""
    position = max(m.position_scale, g.pose_position_noise**2)
    attitude = max(m.attitude_scale, g.pose_attitude_noise**2)
    return g.pose_gate * math.sqrt(position), g.pose_gate * math.sqrt(attitude)


@compiled(inner=True)
def refuse(m: Item, stamp_ns: int, offset_w: Triple, turn: Quaternion, g: Item) -> bool:
    """Compare a refused pose with the run; return whether the estimate is to be moved to it.

    Args:
        offset_w: m, from the prediction.
        turn: from the predicted attitude, body axes.
    """
    if m.pose_stamp_ns == m.newest_ns:  # the previous one was used
        recent = 1e-9 * (stamp_ns - m.pose_stamp_ns) <= JUMP_INTERVAL
        m.jumped = 1 if recent and m.distance < 0.25 * g.pose_gate**2 else 0
        m.agreement = _REFUSED
    t = 1e-9 * (stamp_ns - m.run_ns)
    near, level = _reach(m, g)
    near, level = math.sqrt(2.0) * near + RUN_SPEED * t, math.sqrt(2.0) * level + RUN_RATE * t
    apart = subtract(offset_w, vector(m.run_offset_w))
    w, x, y, z = quaternion(m.run_turn)
    turned = multiply((w, -x, -y, -z), turn)
    stands = m.run_count > 0 and t <= RUN_GAP
    if stands and dot(apart, apart) < near * near and chord2(turned) < level * level:
        m.run_count += 1
    else:
        adapt(m, stamp_ns, dot(offset_w, offset_w), chord2(turn), g)
        if stands and m.run_count > 1:
            m.run_count -= 1
            return False
        m.run_count, m.run_start_ns = 1, stamp_ns
        for i in range(3):
            m.run_first_w[i] = offset_w[i]
    m.run_ns = stamp_ns
    for i in range(3):
        m.run_offset_w[i] = offset_w[i]
    for i in range(4):
        m.run_turn[i] = turn[i]
    if m.run_count < RUN_LEAST:
        return False
    m.agreement = _JUMPED if m.jumped == 1 else _DRIFTED
    wait = JUMP_WAIT if m.jumped == 1 else DRIFT_WAIT
    lasts: bool = 1e-9 * (stamp_ns - m.run_start_ns) >= wait
    return lasts


@compiled(inner=True)
def move_to(m: Item, back: int, stamp_ns: int, offset_w: Triple, turn_w: Triple) -> None:
    """Move the estimate to a run's newest pose: position, attitude, and velocity by the run.

    Args:
        back: as returned by `recall`.
        offset_w: m.
        turn_w: rotation vector, rad, world axes.
    """
    along = 1.0 / max(1e-9 * (stamp_ns - m.run_start_ns), DRIFT_WAIT)
    slope = scale(along, subtract(offset_w, vector(m.run_first_w)))
    amend(m, back, stamp_ns, offset_w, (1.0, 0.0, 0.0), turn_w)
    amend(m, back, stamp_ns, slope, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
    m.pose_stamp_ns = m.newest_ns = m.started_ns = stamp_ns
    m.distance = m.last_turn = 0.0
    for i in range(3):
        m.last_offset_w[i] = 0.0
    m.run_count, m.agreement = 0, _MOVED


@compiled(inner=True)
def chord2(q: Quaternion) -> float:
    """Return (2 sin(angle / 2))^2 of a rotation: the square of a small angle, 4 for half a turn."""
    return 4.0 * (q[1] * q[1] + q[2] * q[2] + q[3] * q[3])


@compiled(inner=True)
def rotation_vector(q: Quaternion) -> Triple:
    """Return the rotation vector (rad) of a unit quaternion or its negative, no longer than pi."""
    sine = math.sqrt(0.25 * chord2(q))
    if sine < 1e-12:
        return 0.0, 0.0, 0.0
    angle = 2.0 * math.atan2(sine, abs(q[0]))
    along = math.copysign(angle / sine, q[0])
    return along * q[1], along * q[2], along * q[3]
