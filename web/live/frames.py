"""The binary frames of `/ws/telemetry`: a page's newest values, and all new samples of its series.

Little endian; every part begins at a multiple of 8 bytes:

- uint16 id of the subscription, uint16 number of series, uint16 number of newest values, uint16
  number of samples that became one because the page is slow (1: every sample is sent)
- float64 origin: s of the vehicle's epoch, from which all times count; when it changes, the
  vehicle's clock began anew
- float64 the vehicle's time by now
- uint16 age in ms (65535: never or longer) of each topic of the signals, in the order of
  `web.latest.STALE`
- float32 newest values
- for each series: uint32 its place in the subscription, uint32 number of samples, uint32 number of
  holes, uint32 number of samples that became one; float64 time of each sample; for each of its
  signals float32 values; for each hole float64 time and float64 number of missing ticks, 0 where
  messages were away for longer than their deadline

Of every several samples that became one, three are sent: least, greatest and newest value. A hole
has one sample more, of no value.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from web.signals.signal import Array

Indices = npt.NDArray[np.int64]
NEVER = 65535
HEAD = struct.Struct("<HHHHdd")
SERIES = struct.Struct("<IIII")
LEVELS = ((6000, 1), (24_000, 8), (96_000, 32), (math.inf, 128))
"""Distances back, in samples from the newest, each with how many samples become one there."""
MOST_AT_ONCE = 8192
"""Number of samples that are computed for one frame; more would hold up the event loop."""


class Piece(NamedTuple):
    """Samples `first` to `last` - 1, of which every `bin` become one."""

    first: int
    last: int
    bin: int


def piece(first: int, count: int, slowness: int) -> Piece:
    """Return the next of `count` samples to send to a page that has the samples before `first`.

    What it has missed long ago is sent coarser, and so is everything to a slow page.
    """
    behind, nearer = count - first, 0
    for reach, size in LEVELS:
        if behind <= reach:
            last = min(first + MOST_AT_ONCE, count - nearer)
            return Piece(first, last, max(size, slowness))
        nearer = int(reach)
    raise AssertionError


def joined(
    times: Array, columns: Sequence[Array], of: int, before: Mapping[int, int]
) -> tuple[Array, list[Array], list[tuple[float, float]]]:
    """Return times, columns and holes as they are sent.

    Args:
        times: of the sample before, or NaN, and of N samples, s, (N + 1,).
        columns: of N samples, (N,) each.
        of: number of samples that become one.
        before: index of a sample → number of ticks missing before it.
    """
    holes = np.array(sorted(before), np.int64)
    found = times[1:]
    if of > 1 and len(found):
        begins = np.union1d(np.arange(0, len(found), of), holes)
        ends = np.append(begins[1:], len(found)) - 1
        keys = np.stack([begins, (begins + ends) // 2, ends], axis=1).ravel()
        columns = [_extremes(one, begins, ends) for one in columns]
        found, places = found[keys], 3 * np.searchsorted(begins, holes)
    else:
        places = holes
    if not len(holes):
        return found, list(columns), []
    middles = [0.5 * (times[k] + times[k + 1]) for k in holes.tolist()]
    missing = [float(before[k]) for k in holes.tolist()]
    parted = [np.insert(one, places, np.nan) for one in columns]
    return np.insert(found, places, middles), parted, list(zip(middles, missing, strict=True))


def _extremes(column: Array, begins: Indices, ends: Indices) -> Array:
    least, most = np.fmin.reduceat(column, begins), np.fmax.reduceat(column, begins)
    return np.stack([least, most, column[ends]], axis=1).ravel()


def series(
    place: int,
    of: int,
    times: Array,
    columns: Sequence[Array],
    holes: Sequence[tuple[float, float]],
) -> bytes:
    """Return the part of one series."""
    values = b"".join(column.astype("<f4").tobytes() for column in columns)
    parts = (
        SERIES.pack(place, len(times), len(holes), of),
        times.astype("<f8").tobytes(),
        padded(values),
        np.array(holes, "<f8").tobytes(),
    )
    return b"".join(parts)


def frame(
    identity: int,
    slowness: int,
    clock: tuple[float, float],
    ages: Sequence[float],
    values: Sequence[float],
    parts: Sequence[bytes] = (),
) -> bytes:
    """Return one frame; `clock` has origin and the vehicle's time, s, `ages` are in s."""
    milliseconds = [min(NEVER, round(1e3 * age)) if math.isfinite(age) else NEVER for age in ages]
    return b"".join(
        (
            HEAD.pack(identity, len(parts), len(values), slowness, *clock),
            padded(struct.pack(f"<{len(ages)}H", *milliseconds)),
            padded(struct.pack(f"<{len(values)}f", *values)),
            *parts,
        )
    )


def padded(part: bytes) -> bytes:
    return part + bytes(-len(part) % 8)
