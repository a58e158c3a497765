"""The notes of the two ends of `python -m benchmarks link`, and the figures computed from them.

All times are ns of CLOCK_MONOTONIC, which the ends share.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

MS = 1e-6
Rows = npt.NDArray[Any]


class Notebook:
    """Rows of int64 in memory allocated at once, so that notes do not look like a leak.

    Args:
        most: number of rows; later ones are dropped.
    """

    def __init__(self, most: int, columns: int) -> None:
        self._rows = np.full((most, columns), -1, np.int64)
        self._count = 0

    def add(self, *values: int) -> None:
        if self._count < len(self._rows):
            self._rows[self._count] = values
            self._count += 1

    @property
    def rows(self) -> Rows:
        return self._rows[: self._count]


@dataclass(frozen=True)
class Found:
    """The notes of both ends.

    Attributes:
        telemetry: number, sent, received, 1 if it was to be shown, 1 if it arrived as a datagram.
        udp, poses, udp_poses: number, sent, received; poses are received at the vehicle.
        calls: requested, ns until answered or -1.
        states: when the station's view of the link changed, 0 good 1 degraded 2 lost.
        silences: when the vehicle started or stopped missing the station, 1 or 0.
        download: when a piece arrived, its bytes.
    """

    telemetry: Rows
    udp: Rows
    poses: Rows
    udp_poses: Rows
    calls: Rows
    states: Rows
    silences: Rows
    download: Rows

    def between(self, begin: float, end: float) -> Found:
        """Return what was sent, requested or noted from `begin` until `end`."""
        when = {"telemetry": 1, "udp": 1, "poses": 1, "udp_poses": 1}
        kept = {}
        for name, rows in vars(self).items():
            at = rows[:, when.get(name, 0)]
            kept[name] = rows[(at >= begin) & (at < end)]
        return Found(**kept)


def delays(rows: Rows) -> npt.NDArray[np.float64]:
    """Return the delays (ms) of received messages."""
    return np.asarray((rows[:, 2] - rows[:, 1]) * MS, np.float64)


def ages(rows: Rows) -> npt.NDArray[np.float64]:
    """Return the age (ms) of the newest message at each millisecond."""
    heard = rows[np.argsort(rows[:, 2], kind="stable")]
    newest = np.maximum.accumulate(heard[:, 1])
    moments = np.arange(heard[0, 2], heard[-1, 2], 1_000_000)
    at = np.searchsorted(heard[:, 2], moments, side="right") - 1
    return np.asarray((moments - newest[at]) * MS, np.float64)


def beside(rows: Rows, udp: Rows, most: float) -> Rows:
    """Return the received packets sent between two packets of plain UDP of at most `most` ms each.

    Both machines were running then, however long `rows` themselves took.
    """
    sent = udp[np.argsort(udp[:, 1], kind="stable")]
    after = np.searchsorted(sent[:, 1], rows[:, 1])
    inside = (after > 0) & (after < len(sent))
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(sent) - 1)
    took = delays(sent)
    near = sent[after, 0] == sent[before, 0] + 1  # none lost in between
    found: Rows = rows[inside & near & (took[before] <= most) & (took[after] <= most)]
    return found


def lost(rows: Rows) -> float:
    """Return the loss (%) between the first and the last message received."""
    numbers = np.unique(rows[:, 0])
    return float(100.0 * (1.0 - len(numbers) / (numbers[-1] - numbers[0] + 1)))


def p50(values: npt.NDArray[np.float64]) -> float:
    return float(np.percentile(values, 50))


def p99(values: npt.NDArray[np.float64]) -> float:
    return float(np.percentile(values, 99))


def answers(calls: Rows) -> npt.NDArray[np.float64]:
    """Return the ms until the answers of calls that were answered."""
    return np.asarray(calls[calls[:, 1] >= 0, 1] * MS, np.float64)


def unanswered(calls: Rows) -> int:
    return int((calls[:, 1] < 0).sum())
