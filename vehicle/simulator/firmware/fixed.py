"""Arithmetic of the firmware: products, roots and angles of whole numbers, as on the chip.

A product keeps 32 of its 48 bits. `firmware/core/fixed.h` has the same functions.
"""

from __future__ import annotations

from quadrotor.compiled import compiled
from vehicle.simulator.firmware import constants as k


@compiled(inner=True)
def by16(a: int, b: int) -> int:
    """Return a b / 2^16, rounded, for a of 32 bits and b of 16 bits."""
    return (a * b + 0x8000) >> 16


@compiled(inner=True)
def bounded(value: int, most: int) -> int:
    """Return the value limited to -most..most."""
    return min(most, max(-most, value))


@compiled(inner=True)
def root(square: int) -> int:
    """Return the integer part of the square root of an unsigned 32-bit number."""
    rest, out, bit = square, 0, 1 << 30
    for _ in range(16):
        if rest >= out + bit:
            rest -= out + bit
            out = (out >> 1) + bit
        else:
            out >>= 1
        bit >>= 2
    return out


@compiled(inner=True)
def angle_of(y: int, x: int) -> int:
    """Return atan2(y, x) in 2^-15 rad for 16-bit numbers; 0 if both are 0."""
    high, low = max(abs(x), abs(y)), min(abs(x), abs(y))
    if high == 0:
        return 0
    t = min(32767, (low << 15) // high)
    square = (t * t) >> 15
    out = k.ATAN_7 + ((k.ATAN_9 * square) >> 15)
    out = k.ATAN_5 + ((out * square) >> 15)
    out = k.ATAN_3 + ((out * square) >> 15)
    out = k.ATAN_1 + ((out * square) >> 15)
    out = (t * out + 0x4000) >> 15
    if abs(y) > abs(x):
        out = k.QUARTER_TURN - out
    if x < 0:
        out = k.HALF_TURN - out
    return -out if y < 0 else out
