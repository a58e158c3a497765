"""The evidence against the tracker, and what is learnt from poses that are not doubted.

The evidence is the logarithm of the likelihood that t, the tracker's motion, has nothing to do with
g, that of the IMU, over that it equals g: the sum of (|g|² - 2 t·g) / 2σ², kept between 0 and a
limit (CUSUM: Page, Biometrika 1954). Axes that are reversed or permuted leave |t| as large as |g|,
and add to it with every motion; a true pose takes away. A share of the motion counts as noise,
because small errors of axes, scales and stamps are no reason to stop flying; a turn that may be the
gyroscope's noise alone is no evidence, nor is a motion that the tracker alone shows: it is judged
by the gate.
"""

from __future__ import annotations

import math

from estimation.tracker_integrity.memory import LEVEL, PLACE, TILT, TURN
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Vector, dot, length, subtract, vector

KNOWN = 0.5
"""Time, in s, after which the means are known."""
UNKNOWN = 0.03
"""Deviation, in m, of a displacement after another start, when velocity and vertical may be wrong;
it decays in `MOTION_TIME`."""
OFFSET_TIME = 1.5
"""Time constant, in s, of the means of g - t, which begin with a plain mean."""
NOISE_TIME = 4.0
"""Time constant, in s, of the variances of the differences, which begin with a plain mean."""
CORRELATION = 0.05
"""Time, in s, within which the errors of displacements are alike."""
MOTION_TIME = 1.0
"""Time constant, in s, of the mean square motion."""
LEAST_TURN, LEAST_PLACE = math.radians(0.1), 0.003
"""Least deviations of the differences, rad and m."""
FELT_TURN = math.radians(0.3)
"""Turn, rad rms, that may be the noise of the gyroscope alone, which adds up for 1 s: at
rest it is up to 0.1 deg."""
SUDDEN = 0.5
"""Share of a turn now that is surely not that noise, before its mean square is known."""
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
ALARM = 15.0
"""Evidence with which the tracker counts as wrong; without any it is right again."""
DECIDED = 4.0
"""Size from which on the vote of the witnesses counts: the odds are 55 to 1."""
AGREED = 2.0
"""Agreement about one axis from which on it counts: the odds are 7 to 1."""
DISAGREED, DISAGREED_ALL = 1.0, 0.5
"""Disagreement about one axis, and about all, from which on a slow turn may be a lie and not a bias
alone."""
SLOWEST, FASTEST = 10.0, 250.0
"""Changes of the evidence, 1/s: smaller ones are noise on a mean that is not exact, and count as
none; larger ones count as this, because one pose alone shows nothing."""


@compiled(inner=True)
def unknown(m: Item) -> float:
    """Return the variance, in m², of a displacement by an unknown start."""
    return UNKNOWN**2 * math.exp(-2.0 * m.settled / MOTION_TIME)


@compiled(inner=True)
def has_jumped(m: Item, since: float, shown_b: Vector, felt_b: Vector) -> bool:
    """Return whether the attitude changed by more than noise and a lie about the rate."""
    felt = length(felt_b) * min(1.0, USUAL_INTERVAL / since)
    far = length(subtract(shown_b, felt_b))
    return not far < 2.0 * felt + JUMP * math.sqrt(m.turn_variance)


@compiled(inner=True)
def is_outlier(t: Vector, g: Vector, variance: float) -> bool:
    far = length(subtract(t, g))
    return not far < 2.0 * length(g) + OUTLIER * math.sqrt(variance)


@compiled(inner=True)
def agrees(m: Item) -> bool:
    """Return whether quick turns agree about both axes: a lie may leave the third as it is, or two
    of the three.
    """
    found: bool = min(m.agreement[0], m.agreement[1]) > AGREED
    return found


@compiled(inner=True)
def contradicts(m: Item) -> bool:
    """Return whether quick turns disagree about one axis, or on the whole: a bias does not."""
    a = m.agreement
    found: bool = min(a[0], a[1], a[2]) < -DISAGREED or a[0] + a[1] + a[2] < -DISAGREED_ALL
    return found


@compiled(inner=True)
def strongest(m: Item) -> float:
    """Return the strongest evidence against the tracker, without the faults that the witnesses rule
    out.
    """
    e = m.evidence
    of_turn = max(e[TURN], e[TILT])
    if not contradicts(m):
        of_turn = 0.0 if agrees(m) else min(of_turn, DOUBTED)
    most: float = of_turn if m.vote > DECIDED else max(of_turn, e[PLACE], e[LEVEL])
    return most


@compiled(inner=True)
def is_doubted(m: Item) -> bool:
    """Return whether nothing may be learnt from the poses."""
    return strongest(m) >= DOUBTED


@compiled(inner=True)
def judge(m: Item, since: float, t_b: Vector, g_b: Vector, t_w: Vector, g_w: Vector) -> None:
    """Add to the evidence, and learn from the differences."""
    _weigh(m, TURN, t_b, g_b, since)
    _weigh(m, TILT, _level(t_b), _level(g_b), since)
    _weigh(m, PLACE, t_w, g_w, since)
    _weigh(m, LEVEL, _level(t_w), _level(g_w), since)
    m.learnt += since
    if is_doubted(m):
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
    m.turn_variance = learnt(m.turn_variance, difference_b, share, LEAST_TURN)
    m.place_variance = learnt(m.place_variance, difference_w, share, LEAST_PLACE)
    share = min(1.0, since / min(m.learnt, OFFSET_TIME))
    for i in range(3):
        m.place_offset_w[i] += share * difference_w[i]


@compiled(inner=True)
def _level(v: Vector) -> Vector:
    return v[0], v[1], 0.0


@compiled(inner=True)
def _weigh(m: Item, test: int, t: Vector, g: Vector, since: float) -> None:
    """Add to the evidence of one test, once the means are known."""
    shown, felt = length(t), length(g)
    m.motion[test] += min(1.0, since / MOTION_TIME) * (felt * felt - m.motion[test])
    if m.learnt < KNOWN:
        return
    of_turn = test < PLACE
    variance = m.turn_variance if of_turn else m.place_variance
    offset = 0.0 if of_turn else length(vector(m.place_offset_w))
    every = m.motion[TURN if of_turn else PLACE]
    errors = max(m.motion[test], felt * felt) + SKEW**2 * every + offset * offset
    uncertain = variance + ERROR**2 * errors
    if not of_turn:
        uncertain = (uncertain + unknown(m)) * max(1.0, CORRELATION / since)
    found = 0.5 * (felt * felt - 2.0 * dot(t, g)) / uncertain
    if of_turn:
        moved = max(m.motion[test], SUDDEN**2 * felt * felt, FELT_TURN**2)
        found *= 1.0 - FELT_TURN**2 / moved
    if found > 0.0 and not (SMALLER * felt < shown < LARGER * felt + VISIBLE * math.sqrt(variance)):
        return
    size = min(max(0.0, abs(found) - SLOWEST * since), FASTEST * since)
    m.evidence[test] = max(0.0, min(m.evidence[test] + math.copysign(size, found), MOST))


@compiled(inner=True)
def learnt(variance: float, difference: Vector, share: float, least: float) -> float:
    square = min(dot(difference, difference) / 3.0, 9.0 * variance)
    return max(variance + share * (square - variance), least * least)
