"""Several flights in one file, told apart by the stamps of its IMU."""

from __future__ import annotations

import itertools

import numpy as np

from extensions.importers.rows import Places, largest_step, steps_where
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

FEWEST = 50
"""Least number of rows of IMU or truth for an import."""
GAP = 60.0
"""s without a row after which another flight may begin."""
LONGEST_GAP = 3600.0
"""s without a row within one flight."""
LEAST_STEP = 1.0
"""s by which a clock goes back at least when it begins anew."""
MARGIN = 1.0
"""s by which tracks may reach beyond the IMU of their flight."""
SHOWN = 12
"""Largest number of flights listed in a message."""


class Flights:
    """The flight of a file that is read: the IMU's rows decide where flights begin.

    A new flight begins where the clock begins anew, and after a gap of a minute.

    Args:
        number: which flight is read, from 1; None: the only one.
    """

    def __init__(self, number: int | None) -> None:
        self._number = number
        self.count = 1
        self.later = 0.0
        """s from the end of the flight to that of the file, without pauses between two starts."""
        self._start = 0  # how often the clock had begun anew before the flight
        self._starts = 1
        self._span = (-np.inf, np.inf)

    def of_imu(self, seconds: Array, where: str) -> tuple[slice, list[str]]:
        """Return the IMU's rows of the flight, and notes. Raises LogFormatError, with what to try
        if a number is needed or is none of the file's.
        """
        starts = _begins_anew(seconds)
        gaps = steps_where(seconds, lambda steps: steps > GAP) + 1
        parts = _parts(seconds, np.union1d(starts, gaps))
        self.count = len(parts)
        told = "; ".join(
            f"{k}: {len(seconds[one])} rows, {seconds[one][-1] - seconds[one][0]:.1f} s"
            for k, one in enumerate(parts[:SHOWN], 1)
        ) + f" and {len(parts) - SHOWN} more" * (len(parts) > SHOWN)
        if self._number is None:
            is_apart = bool(len(starts) or len(steps_where(seconds, lambda s: s > LONGEST_GAP)))
            if len(parts) > 1 and is_apart:
                raise LogFormatError(
                    f"{where} has {len(parts)} flights ({told}): --flight 1 imports the first, "
                    "--flight all imports each as a run"
                )
            alone = len(seconds) - len(seconds[parts[0]])
            if len(parts) == 1 and alone and not is_apart:
                self._limit_to(seconds[parts[0]])
                return parts[0], [
                    f"{where}: {alone} rows left out that are {GAP:.0f} s or more away from all "
                    "others"
                ]
            if len(parts) == 1:
                return slice(None), []
            k = largest_step(seconds)
            return slice(None), [
                f"{where}: a gap of {seconds[k + 1] - seconds[k]:.1f} s; --flight all imports the "
                f"parts as runs ({told})"
            ]
        if not 1 <= self._number <= len(parts):
            raise LogFormatError(
                f"{where} has no flight {self._number}: there "
                + (f"are {len(parts)} ({told})" if len(parts) > 1 else "is one, without --flight")
            )
        chosen = parts[self._number - 1]
        runs = np.split(seconds, starts[starts >= chosen.stop])
        self.later = float(
            runs[0][-1] - seconds[chosen][-1] + sum(one[-1] - one[0] for one in runs[1:])
        )
        self._start = int(np.searchsorted(starts, chosen.start, "right"))
        self._starts = len(starts) + 1
        self._limit_to(seconds[chosen])
        return chosen, []

    def _limit_to(self, seconds: Array) -> None:
        """Limit tracks on the IMU's clock to the times of the flight."""
        self._span = (float(seconds[0]) - MARGIN, float(seconds[-1]) + MARGIN)

    def of_track(self, seconds: Array, where: str, *, same_clock: bool) -> Places:
        """Return the rows of another table that belong to the flight, as numbers of rows.

        Args:
            same_clock: whether its times are the IMU's.

        Raises LogFormatError.
        """
        rows = np.arange(len(seconds))
        starts = _begins_anew(seconds) if self._number is not None else rows[:0]
        if len(starts) and len(starts) + 1 != self._starts:
            raise LogFormatError(
                f"{where}: its clock begins anew {len(starts)} times, that of [imu] "
                f"{self._starts - 1} times: which rows belong to one flight cannot be told; cut "
                "the file into flights"
            )
        if len(starts):
            rows = np.split(rows, starts)[self._start]
        if same_clock:
            inside = (seconds[rows] >= self._span[0]) & (seconds[rows] <= self._span[1])
            rows = rows[inside]
        return rows


def _begins_anew(seconds: Array) -> Places:
    """Return the rows at which the clock begins anew, with as many rows on each side as a flight
    has; stamps that only go back for a moment are none.
    """
    back = steps_where(seconds, lambda steps: steps < -LEAST_STEP) + 1
    edges = np.concatenate([[0], back, [len(seconds)]])
    return back if (np.diff(edges) >= FEWEST).all() else back[:0]


def _parts(seconds: Array, begins: Places) -> list[slice]:
    """Return the parts of a file that are long enough for a flight."""
    edges = [0, *begins.tolist(), len(seconds)]
    parts = [slice(a, b) for a, b in itertools.pairwise(edges) if b - a >= FEWEST]
    return parts or [slice(0, len(seconds))]
