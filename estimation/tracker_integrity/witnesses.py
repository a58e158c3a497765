"""The vote on which of two that contradict each other is wrong: the tracker, or the IMU.

Two more witnesses saw the displacement that is in dispute. The motors pull along z_B with a thrust
that is commanded: turned by the tracker's attitude, with gravity, it gives a displacement as the
accelerometer does, and needs no sensor. The barometer shows the vertical part. Both pass through
the high-pass of displacements. The vote is the logarithm of the likelihood of what they say if the
tracker is right over that if the accelerometer is right, the sum of (|w - g|² - |w - t|²) / 2σ²,
which fades. It needs no model of what is wrong: where t and g are alike nothing is added.

Thrust that is not as commanded, drag and gusts are errors of the motors. Their mean is taken off,
and σ is learnt, from t while nothing contradicts it. With a witness too noisy to tell, the vote
stays undecided.

The vote says nothing about the attitude: that of a left-handed tracker fits its positions.
"""

from __future__ import annotations

import math

from estimation.tracker_integrity.evidence import (
    ALARM,
    CORRELATION,
    DECIDED,
    ERROR,
    LEAST_PLACE,
    NOISE_TIME,
    OFFSET_TIME,
    agrees,
    is_doubted,
    learnt,
    unknown,
)
from estimation.tracker_integrity.memory import LEVEL, PLACE, TILT, TURN
from quadrotor.compiled import compiled
from quadrotor.records import Item
from quadrotor.vectors import Vector, dot, subtract

FADING, QUICK_FADING = 1.0, 0.7
"""Time constants, in s, of the vote and of agreement."""
GUST = 0.4
"""Time, in s, within which the errors of the motors' displacements are alike."""
SLOW = math.radians(0.2)
"""Quick turn, in rad, below which it may be what a bias that changes leaves: that of a change by
0.8 deg/s each second."""
AIRBORNE = 1.0
"""Time, in s, from which on the motors have carried the vehicle and not the ground."""
LARGEST, LARGEST_AGREEMENT = 20.0, 3.0
"""Largest sizes of the vote, and of an agreement, which a lie, or its end, must soon undo."""


@compiled(inner=True)
def vote(m: Item, since: float, t: Vector, g: Vector, driven: Vector, height: float) -> None:
    """Add the votes of the witnesses on one pose.

    Args:
        t, g, driven, height: displacements (m) by the tracker, the accelerometer, the motors, and
            upwards by the barometer.
    """
    said = min(1.0, since / GUST) * _said(driven, t, g, m.driven_variance + unknown(m))
    up, t_up, g_up = (0.0, 0.0, height), (0.0, 0.0, t[2]), (0.0, 0.0, g[2])
    said += min(1.0, since / CORRELATION) * _said(up, t_up, g_up, m.height_variance)
    sum_ = max(0.0, 1.0 - since / FADING) * m.vote + said
    m.vote = min(LARGEST, max(-LARGEST, sum_)) if m.carried > AIRBORNE else 0.0
    if is_doubted(m) or m.carried <= 0.0:
        return
    off = subtract(driven, t)
    share = min(1.0, since / min(m.carried, NOISE_TIME))
    m.driven_variance = learnt(m.driven_variance, off, share, LEAST_PLACE)
    off_up = math.sqrt(3.0) * (height - t[2])
    m.height_variance = learnt(m.height_variance, (0.0, 0.0, off_up), share, LEAST_PLACE)
    share = min(1.0, since / min(m.carried, OFFSET_TIME))
    for i in range(3):
        m.driven_offset_w[i] += share * off[i]


@compiled(inner=True)
def agree(m: Item, since: float, t: Vector, g: Vector) -> None:
    """Add whether quick turns (rad) of tracker and gyroscope agree, in which no bias shows."""
    uncertain = m.turn_variance + ERROR**2 * dot(g, g)
    left, share = max(0.0, 1.0 - since / QUICK_FADING), min(1.0, since / CORRELATION)
    for i in range(3):
        said = share * (t[i] * g[i] - 0.5 * g[i] * g[i]) / uncertain
        if said < 0.0:
            said *= max(0.0, 1.0 - (SLOW / max(abs(g[i]), SLOW)) ** 2)
        sum_ = left * m.agreement[i] + said
        m.agreement[i] = min(LARGEST_AGREEMENT, max(-LARGEST_AGREEMENT, sum_))


@compiled(inner=True)
def overrule(m: Item) -> None:
    """Dismiss an alarm by slow turns alone, and one by displacements that the witnesses have seen
    as the tracker has.
    """
    e = m.evidence
    if agrees(m) and max(e[TURN], e[TILT]) >= ALARM:
        e[TURN] = e[TILT] = 0.0
        m.overruled[0] += 1
    if m.vote > DECIDED and max(e[PLACE], e[LEVEL]) >= ALARM:
        e[PLACE] = e[LEVEL] = 0.0
        m.overruled[1] += 1


@compiled(inner=True)
def _said(w: Vector, t: Vector, g: Vector, variance: float) -> float:
    off_g, off_t = subtract(w, g), subtract(w, t)
    uncertain = variance + ERROR**2 * dot(w, w)
    return 0.5 * (dot(off_g, off_g) - dot(off_t, off_t)) / uncertain
