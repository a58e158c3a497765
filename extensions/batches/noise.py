"""Random numbers inside compiled loops: one small generator per vehicle, stored in its record.

xoshiro256++ (Blackman, Vigna 2021), seeded by splitmix64 as its authors advise, and normal numbers
by the ziggurat (Marsaglia, Tsang 2000) with 256 layers and a position independent of the layer
(Doornik 2005). A vehicle's numbers depend only on its seed: not on its place in a batch, nor on the
number of threads.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from bearing_sim.sampling import ALL, STEP, splitmix64
from quadrotor.compiled import compiled

Array = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint64]

LAYERS = 256
TAIL = 3.6541528853610088
"""Start of the tail for which each of 256 layers has the same area."""

_R17, _R23, _R41, _R45, _R19 = (np.uint64(n) for n in (17, 23, 41, 45, 19))


def _ziggurat() -> tuple[Array, Array]:
    """Return right edges (257,) of the layers, bottom first, and each edge over the one below."""
    density = math.exp(-0.5 * TAIL * TAIL)
    area = TAIL * density + math.sqrt(0.5 * math.pi) * math.erfc(TAIL / math.sqrt(2.0))
    edges = np.zeros(LAYERS + 1)
    edges[0], edges[1] = area / density, TAIL
    for i in range(2, LAYERS):
        density += area / edges[i - 1]
        edges[i] = math.sqrt(-2.0 * math.log(density))
    return edges, edges[1:] / edges[:-1]


EDGES, INNER = _ziggurat()


def seeded(seeds: list[int]) -> Words:
    """Return generators (len(seeds), 4) from whole numbers: the next four words of splitmix64."""
    out = np.empty((len(seeds), 4), np.uint64)
    for k, seed in enumerate(seeds):
        for i in range(4):
            out[k, i] = splitmix64(seed + (i + 1) * STEP & ALL)
    return out


@compiled
def word(s: Words) -> np.uint64:
    """Return the next 64 random bits of one generator (4,), and advance it."""
    a, b, c, d = s[0], s[1], s[2], s[3]
    sum_ = a + d
    out: np.uint64 = ((sum_ << _R23) | (sum_ >> _R41)) + a
    c ^= a
    d ^= b
    s[0], s[1], s[2] = a ^ d, b ^ c, c ^ (b << _R17)
    s[3] = (d << _R45) | (d >> _R19)
    return out


@compiled
def uniform(s: Words) -> float:
    """Return a number in 0..1, 1 excluded."""
    out: float = np.int64(word(s) >> np.uint64(11)) * 2.0**-53
    return out


@compiled
def normal(s: Words) -> float:
    """Return a standard normal number."""
    while True:
        bits = word(s)
        layer = np.int64(bits & np.uint64(LAYERS - 1))
        u = (np.int64(bits) >> 11) * 2.0**-52  # -1..1, from other bits than the layer's
        x: float = u * EDGES[layer]
        if abs(u) < INNER[layer]:
            return x
        if layer == 0:
            return _tail(s) if u > 0.0 else -_tail(s)
        low = math.exp(0.5 * (x * x - EDGES[layer] * EDGES[layer]))
        high = math.exp(0.5 * (x * x - EDGES[layer + 1] * EDGES[layer + 1]))
        if low + uniform(s) * (high - low) < 1.0:
            return x


@compiled(inner=True)
def _tail(s: Words) -> float:
    """Return a normal number beyond TAIL (Marsaglia 1964)."""
    while True:
        x = -math.log(1.0 - uniform(s)) / TAIL
        y = -math.log(1.0 - uniform(s))
        if 2.0 * y > x * x:
            return TAIL + x


@compiled(inner=True)
def normals(s: Words, out: Array) -> None:
    """Fill `out` (N,) with standard normal numbers."""
    for i in range(out.shape[0]):
        out[i] = normal(s)
