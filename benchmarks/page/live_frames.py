"""Frames of `/ws/telemetry` (web.live.frames), read as a page reads them."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from web.live.frames import HEAD, NEVER, SERIES
from web.live.telemetry import topics_of


@dataclass
class Columns:
    """New samples of a series; of every `of` of them one was made."""

    time: npt.NDArray[np.float64]
    values: dict[str, npt.NDArray[np.float32]]
    holes: list[tuple[float, float]]
    of: int


@dataclass
class Frame:
    """A frame; `series` by their places in the subscription."""

    id: int
    slowness: int
    origin: float
    now: float
    ages: dict[str, float]
    newest: dict[str, float]
    series: dict[int, Columns] = field(default_factory=dict)


def read(raw: bytes, signals: Sequence[str], series: Sequence[Sequence[str]] = ()) -> Frame:
    """Read a frame of a subscription to these signals and series."""
    identity, parts, count, slowness, origin, now = HEAD.unpack_from(raw)
    topics = topics_of([*signals, *(name for one in series for name in one)])
    at = HEAD.size
    ages = struct.unpack_from(f"<{len(topics)}H", raw, at)
    at += padded(2 * len(topics))
    values = struct.unpack_from(f"<{count}f", raw, at)
    at += padded(4 * count)
    known = [math.inf if one == NEVER else one / 1e3 for one in ages]
    newest = dict(zip(signals, values, strict=True))
    age = dict(zip(topics, known, strict=True))
    found = Frame(identity, slowness, origin, now, age, newest)
    for _ in range(parts):
        place, rows, holes, of = SERIES.unpack_from(raw, at)
        at += SERIES.size
        time = np.frombuffer(raw, "<f8", rows, at)
        at += 8 * rows
        columns = {}
        for k, name in enumerate(series[place]):
            columns[name] = np.frombuffer(raw, "<f4", rows, at + 4 * k * rows)
        at += padded(4 * rows * len(series[place]))
        pairs = np.frombuffer(raw, "<f8", 2 * holes, at).reshape(-1, 2)
        at += 16 * holes
        found.series[place] = Columns(time, columns, [(a, b) for a, b in pairs.tolist()], of)
    assert at == len(raw)
    return found


def padded(size: int) -> int:
    return -(-size // 8) * 8
