"""The tracking error of the behavior that is flown, from every message, as a verdict computes it.

Pieces of it are compared as they arrive, by `console.evaluation.tracking.compare`; the figures of
the behavior, and of the lap under way, are computed from all pieces by `TrackingErrors.metrics`.
"""

from __future__ import annotations

import math

import numpy as np

from console.evaluation.tracking import TRUE, WANTED, Compared, Rows, TrackingErrors, compare
from flight_log.payload_layout import HEADER_STAMP
from quadrotor.json_object import JsonObject
from quadrotor.records import Array, Stamps
from web.live.growing import Growing
from web.live.signal_log import SignalLog
from web.live.topic_logs import MessageLog, TickLog
from web.signals.evaluator import count_before

SECOND_NS = 1_000_000_000
FLOWN = ("hover", "fly_to", "follow_trajectory", "velocity", "brake", "external", "excite")
"""Behaviors with a reference in the air."""
LONGEST = 3600.0
"""Seconds of a behavior that count: its last hour."""
FIELDS = (("stamps", np.int64, 0), ("position_w", np.float64, 3), ("yaw", np.float64, 0))
MASKS = (("known", np.bool_, 0), ("far", np.bool_, 0))


class LiveTracking:
    """Figures of the tracking error of the running behavior."""

    def __init__(self, log: SignalLog) -> None:
        self._log = log
        self._origin_ns = self._statuses = 0
        self._behavior, self._begin = "", math.inf
        self._restart()

    def summary(self, laps: int | None = None, duration: float = 0.0) -> JsonObject | None:
        """Return the figures of the behavior and of its lap, None while none is flown.

        Args:
            laps: number of laps of the trajectory under way, if it has any.
            duration: of the trajectory, s.
        """
        self._follow()
        if self._behavior not in FLOWN:
            return None
        self._extend()
        whole = self._figures(self._begin)
        if whole is None:
            return None
        out: JsonObject = {"behavior": self._behavior, **whole}
        if laps and duration > 0.0:
            of = duration / laps
            lap = min(laps - 1, int((self._until - self._begin) / of))
            out = {**out, "lap": self._figures(self._begin + lap * of), "lap_number": lap + 1}
        return out

    def errors(self, begin: float) -> TrackingErrors | None:
        """Return the errors since a time (s since the log's origin), None without any."""
        first = int(np.searchsorted(self._kept["stamps"].rows, self._stamp_ns(begin)))
        kept = {name: one.rows[first:] for name, one in self._kept.items()}
        return Compared(self._topic, **kept).errors() if len(kept["stamps"]) else None

    def _figures(self, begin: float) -> JsonObject | None:
        """Return the figures since a time, and the window (s, vehicle's clock) that they are of."""
        if (errors := self.errors(begin)) is None:
            return None
        window = {"from": 1e-9 * self._stamp_ns(begin), "to": 1e-9 * self._stamp_ns(self._until)}
        return {**errors.metrics(), **window}

    def _stamp_ns(self, time: float) -> int:
        return self._origin_ns + round(SECOND_NS * time)

    def _restart(self) -> None:
        self._topic, self._next, self._until = "", 0, -math.inf
        self._kept = {name: Growing(kind, width) for name, kind, width in (*FIELDS, *MASKS)}

    def _follow(self) -> None:
        """Note which behavior is flown, and since when."""
        log = self._log.log("status")
        if self._origin_ns != self._log.origin_ns or not isinstance(log, MessageLog):
            self._origin_ns, self._statuses, self._behavior = self._log.origin_ns, 0, ""
            self._restart()
        if not isinstance(log, MessageLog):
            return
        first, count = max(0, self._statuses - log.dropped), len(log.time)
        names, flies = (log.values(one, first, count).tolist() for one in ("behavior", "airborne"))
        for k, (name, is_airborne) in enumerate(zip(names, flies, strict=True)):
            behavior = str(name).lower() if is_airborne else ""
            if behavior != self._behavior:
                self._behavior, self._begin = behavior, float(log.time[first + k])
                self._restart()
        self._statuses = log.dropped + count

    def _extend(self) -> None:
        """Compare the true poses that have a reference by now."""
        topic = next((name for name in TRUE if self._log.log(name) is not None), "")
        true, ticks = self._log.log(topic), self._log.log("reference")
        if (
            not isinstance(true, MessageLog)
            or not isinstance(ticks, TickLog)
            or not len(ticks.time)
        ):
            return
        if topic != self._topic:
            self._restart()
            self._topic = topic
        first = max(self._next - true.dropped, count_before(true.time, self._begin - 1e-6))
        last = count_before(true.time, float(ticks.time[-1]))
        if last <= first:
            return
        self._next, self._until = true.dropped + last, float(ticks.time[-1])
        stamps, rows = self._true(true, first, last)
        near = max(0, int(np.searchsorted(ticks.stamps_ns, stamps[0])) - 1)
        until = int(np.searchsorted(ticks.stamps_ns, stamps[-1])) + 1
        reference, state = (
            (ticks.stamps_ns[near:until], self._of_ticks(ticks, name, near, until))
            for name in ("reference", "state")
        )
        piece = compare(topic, (stamps, rows), reference, state)
        for name, one in self._kept.items():
            one.extend(getattr(piece, name))
        stamps = self._kept["stamps"].rows
        old = int(np.searchsorted(stamps, stamps[-1] - round(LONGEST * SECOND_NS)))
        for one in self._kept.values():
            one.drop(old)

    def _true(self, log: MessageLog, first: int, last: int) -> Rows:
        columns = [log.values(name, first, last) for name in WANTED[self._topic]]
        seconds, rest = (one.astype(np.int64) for one in columns[:2])
        stamps: Stamps = seconds * SECOND_NS + rest
        unique, place = np.unique(stamps, return_index=True)
        return unique, np.stack(columns[2:], axis=1).astype(np.float64)[place]

    @staticmethod
    def _of_ticks(log: TickLog, topic: str, first: int, last: int) -> Array:
        names = WANTED[topic][len(HEADER_STAMP) :]
        columns = [log.values(f"{topic}/{name}", first, last) for name in names]
        return np.stack(columns, axis=1).astype(np.float64)
