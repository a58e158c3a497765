"""The poses that count as true, at the estimates' stamps: both arrive late and out of order."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Literal, NamedTuple

from bearing_sim.pose_track import Pose, PoseTrack
from quadrotor.records import Array

Source = Literal["truth", "tracker"]

KEPT = 300
"""Maximum number of poses, and of rows, that wait for the others: 3 s at 100 a second."""
FORGOTTEN_NS = 1_000_000_000
"""Time in ns without the truth after which the tracker's poses count as true."""


class Row(NamedTuple):
    """Estimates at one stamp: names (E,) and states (E, 13), NaN where unknown."""

    stamp_ns: int
    names: tuple[str, ...]
    states: Array


class TruthMerge:
    """Pairs each row, in order, with the true pose at its stamp, once both have arrived."""

    def __init__(self) -> None:
        self._source: Source | None = None
        self._truth_ns = -(1 << 62)
        self.clear()

    def clear(self) -> None:
        """Forget everything that waits, because the stamps have restarted."""
        self._rows: deque[Row] = deque(maxlen=KEPT)
        self._begin_track()

    def _begin_track(self) -> None:
        self._poses: deque[tuple[int, Array, Array]] = deque(maxlen=KEPT)
        self._track = PoseTrack()
        self._after_ns = self._until_ns = self._newest_ns = -(1 << 62)

    @property
    def source(self) -> str:
        """Return the source of the poses that count now; empty before the first."""
        return self._source or ""

    def row(self, row: Row) -> None:
        """Add a row that is newer than all before."""
        self._rows.append(row)

    def pose(self, source: Source, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Add a pose, (3,) m and (4,) unit quaternion. The tracker's are ignored while the truth
        arrives.
        """
        if source == "truth":
            self._truth_ns = stamp_ns
        elif abs(stamp_ns - self._truth_ns) < FORGOTTEN_NS:
            return
        if source != self._source or (self._newest_ns - stamp_ns > FORGOTTEN_NS):
            self._source = source
            self._begin_track()
        self._newest_ns = stamp_ns
        self._poses.append((stamp_ns, position_w, quaternion_wb))

    def compared(self) -> Iterator[tuple[Row, Pose]]:
        """Yield the rows whose true pose is known by now; those in a gap of the truth
        are left out.
        """
        while self._rows:
            row = self._rows[0]
            while self._until_ns < row.stamp_ns and self._poses:
                stamp_ns, position_w, quaternion_wb = self._poses.popleft()
                after_ns = self._track.add(stamp_ns, position_w, quaternion_wb)
                if after_ns is not None:
                    self._after_ns, self._until_ns = after_ns, stamp_ns
            if self._until_ns < row.stamp_ns:
                return
            self._rows.popleft()
            if row.stamp_ns > self._after_ns:
                yield row, self._track.at(row.stamp_ns)
