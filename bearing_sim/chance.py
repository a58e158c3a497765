"""Random numbers that depend only on seed, instant and beacon.

The draws of a frame do not depend on the frames before it, on what is visible, or on the other
beacons: the same seed and the same truth give the same bearings whatever the stamps of the poses.
"""

from __future__ import annotations

import math

ALL = 0xFFFF_FFFF_FFFF_FFFF
STEP = 0x9E37_79B9_7F4A_7C15
"""Increment from one state of SplitMix64 to the next, in 64 bits."""
_UNIT = 2.0**-53


class Draws:
    """Uniform numbers of one stream: SplitMix64 (Steele et al., OOPSLA 2014), keyed by integers."""

    __slots__ = ("_state",)

    def __init__(self, *key: int) -> None:
        state = 0
        for part in key:
            state = splitmix64((state ^ part) + STEP & ALL)
        self._state = state

    def uniform(self) -> float:
        """Return the next number, in (0, 1]."""
        self._state = self._state + STEP & ALL
        return ((splitmix64(self._state) >> 11) + 1) * _UNIT


def splitmix64(z: int) -> int:
    """Return the word that SplitMix64 derives from a state."""
    z = ((z ^ z >> 30) * 0xBF58_476D_1CE4_E5B9) & ALL
    z = ((z ^ z >> 27) * 0x94D0_49BB_1331_11EB) & ALL
    return z ^ z >> 31


def pair(draws: Draws, degrees_of_freedom: float) -> tuple[float, float]:
    """Return two numbers of unit standard deviation, isotropic in their plane.

    Independent N(0, 1) when `degrees_of_freedom` is infinite (Box and Muller, 1958). Otherwise,
    above 2, the bivariate Student t scaled to unit variance: each number is
    t_ν √((ν − 2)/ν), and both are large together, as for an outlier of a direction. Its radius
    √(ν (u^(−2/ν) − 1)) tends to the Gaussian's √(−2 ln u).
    """
    u, angle = draws.uniform(), 2.0 * math.pi * draws.uniform()
    if math.isinf(degrees_of_freedom):
        radius = math.sqrt(-2.0 * math.log(u))
    else:
        grown = math.expm1(-2.0 / degrees_of_freedom * math.log(u))
        radius = math.sqrt((degrees_of_freedom - 2.0) * grown)
    return radius * math.cos(angle), radius * math.sin(angle)


def hidden(seed: int, beacon_id: int, stamp_ns: int, share: float, spell_ns: int) -> bool:
    """Return whether a beacon is hidden at an instant: for `share` of the time, in spells of
    `spell_ns`.

    Time is divided into periods of spell/share, shifted for each beacon, with one spell at a random
    position in each; two spells may adjoin.
    """
    if share <= 0.0:
        return False
    period_ns = max(spell_ns, round(spell_ns / share))
    shift = int(Draws(seed, beacon_id, 1).uniform() * period_ns)
    number, into = divmod(stamp_ns + shift, period_ns)
    begin = Draws(seed, beacon_id, 2, number).uniform() * (period_ns - spell_ns)
    return begin <= into < begin + spell_ns
