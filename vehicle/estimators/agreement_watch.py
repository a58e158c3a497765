"""Reports with flags and log lines when measurements and the estimate in use disagree."""

from __future__ import annotations

import math
from collections.abc import Callable

from estimation.outcome import Agreement
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.modes import Flag

HOLD_NS = 1_000_000_000
"""Time for which a flag stays set after its cause: a single outlier lasts only 10 ms."""
QUIET_NS = 5_000_000_000
"""Least time between two lines about single refused measurements."""

MOVE_NS = 3_000_000_000
"""Time after `expect_move` without reports: the command, the move and the estimate that follows."""

_FLAGS = {
    Agreement.REFUSED: int(Flag.MEASUREMENTS_REFUSED),
    Agreement.JUMPED: int(Flag.MEASUREMENTS_REFUSED | Flag.TRACKER_JUMPED),
    Agreement.DRIFTED: int(Flag.ESTIMATE_DRIFTED),
    Agreement.MOVED: 0,
    Agreement.USED: 0,
}


class AgreementWatch:
    """Monitors the field `agreement` of the estimator in use.

    Args:
        say: takes a line for the log and its level.

    Attributes:
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(self, say: Callable[[str, int], None]) -> None:
        self._say = say
        self._reported_ns = self._moved_ns = -(1 << 62)
        self.begin()

    def begin(self) -> None:
        """Begin again with another estimator; reports about the previous one do not count."""
        self.flags, self._end_ns = 0, 0
        self._agreement = Agreement.USED
        self._refused: int | None = None  # not received yet
        self._reported = 0
        self._farthest = self._largest = 0.0

    def expect_move(self, now_ns: int) -> None:
        """Report nothing for MOVE_NS: the vehicle, motors off, is put elsewhere on purpose."""
        self._moved_ns = now_ns + MOVE_NS

    def step(self, now_ns: int) -> None:
        """Clear flags that have expired; called once a tick while any is set."""
        if now_ns >= self._end_ns:
            self.flags = 0

    def check(self, estimate: Record, now_ns: int) -> None:
        """Check the ESTIMATE (1,) that the estimator reported after a measurement."""
        refused = int(estimate["measurements_refused"][0])
        now, before = Agreement(int(estimate["agreement"][0])), self._agreement
        if self._refused is None:
            self._refused = self._reported = refused - (
                now in (Agreement.REFUSED, Agreement.JUMPED)
            )
        fresh = refused != self._refused
        if now is before and not fresh and now is not Agreement.DRIFTED:
            return
        x, y, z = estimate["position_innovation_w"][0].tolist()
        a, b, c = estimate["attitude_innovation_b"][0].tolist()
        far, turn = math.sqrt(x * x + y * y + z * z), math.sqrt(a * a + b * b + c * c)
        if fresh:
            self._farthest, self._largest = max(self._farthest, far), max(self._largest, turn)
        self._reported = min(self._reported, refused)  # it was reset
        self._refused, self._agreement = refused, now
        if now_ns < self._moved_ns:
            self._count(refused)
            return
        flags = _FLAGS[now]
        if flags:
            self.flags = flags | (self.flags if now_ns < self._end_ns else 0)
            self._end_ns = now_ns + HOLD_NS
        if now is not before:
            self._report_change(now, before, _size(far, turn), refused, now_ns)

    # ------------------------------------------------------------------ lines
    def _report_change(
        self, now: Agreement, before: Agreement, size: str, refused: int, now_ns: int
    ) -> None:
        if now is Agreement.JUMPED:
            self._warn(
                f"the tracker jumped: poses are suddenly {size} from their prediction, and agree "
                "with each other; they are refused for now"
            )
        elif now is Agreement.DRIFTED:
            self._warn(f"the estimate drifted: poses are {size} from their prediction")
        elif now is Agreement.MOVED:
            self._warn(f"the estimate was moved by {size} to the poses{self._count(refused)}")
        elif now is Agreement.USED and before is Agreement.JUMPED:
            self._warn(f"poses agree with the estimate again{self._count(refused)}")
        elif now is Agreement.USED and self._is_news(refused, now_ns):
            self._reported_ns = now_ns
            farthest = _size(self._farthest, self._largest)
            self._warn(f"measurements up to {farthest} from their prediction{self._count(refused)}")

    def _is_news(self, refused: int, now_ns: int) -> bool:
        return refused > self._reported and now_ns - self._reported_ns > QUIET_NS

    def _count(self, refused: int) -> str:
        count = refused - self._reported
        self._reported, self._farthest, self._largest = refused, 0.0, 0.0
        return f"; {count} refused"

    def _warn(self, line: str) -> None:
        self._say(line, mailbox.WARN)


def _size(far: float, turn: float) -> str:
    """Return a distance (m) and a turn (rad) as text."""
    return f"{far:.2f} m, {math.degrees(turn):.1f}°"
