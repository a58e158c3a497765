"""Track of a whole run for the 3D view, at a constant rate: small enough for a browser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

RATE = 50.0  # Hz
MOST_ROWS = 90_000  # 30 min at full rate, 7 MB; longer runs have fewer rows a second
STALE = 0.3  # s
POSITION = tuple(f"pose.pose.position.{axis}" for axis in "xyz")
ROTATION = tuple(f"pose.pose.orientation.{axis}" for axis in "wxyz")
REFERENCE = tuple(f"position.{axis}" for axis in "xyz")
PARTS: dict[str, tuple[str, ...]] = {
    "state": (*POSITION, *ROTATION),
    "reference": REFERENCE,
    "truth": (*POSITION, *ROTATION),
    "actuators": (*(f"motor_references[{k}]" for k in range(4)), "thrust"),
}
"""Topic → its columns, in the order of a row; quaternions are (w, x, y, z), body to world."""
WIDTH = sum(map(len, PARTS.values()))

Source = tuple[npt.NDArray[np.float64], Callable[[str], npt.NDArray[np.float32]]]


def track(duration: float, sources: dict[str, Source]) -> tuple[float, npt.NDArray[np.float32]]:
    """Return the rate in Hz and rows (M, WIDTH): the newest sample of each topic at k / rate.

    NaN where a topic is older than STALE, or not in the log.
    """
    rate = min(RATE, MOST_ROWS / max(duration, 1e-9))
    count = int(duration * rate) + 1
    instants = np.arange(count) / rate
    rows = np.full((count, WIDTH), np.nan, np.float32)
    first = 0
    for topic, columns in PARTS.items():
        its = slice(first, first + len(columns))
        first += len(columns)
        if topic not in sources or len(sources[topic][0]) == 0:
            continue
        times, column = sources[topic]
        index = np.searchsorted(times, instants, side="right") - 1
        age = instants - times[np.maximum(index, 0)]
        fresh = (index >= 0) & (age <= STALE)
        try:
            read = np.stack([column(name) for name in columns], axis=1)
        except KeyError:
            continue  # a topic of this name with another type
        rows[fresh, its] = read[index[fresh]]
    return rate, rows
