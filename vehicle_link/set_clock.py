"""Detection that the computer's clock was set while this program runs."""

from __future__ import annotations

import time
from collections.abc import Callable

from vehicle_link.clock import host_time_ns

SHORTEST_S = 2.0
"""Smaller steps, as for a leap second, are not reported."""


class SetClock:
    """Detector of steps of the computer's clock, against the epoch of `vehicle_link.clock`.

    Args:
        owner: what this computer carries, for the report ("vehicle", "base station").
        computer_ns: the computer's clock as it is set now.
        steady_ns: the same clock as it would be without having been set.
    """

    def __init__(
        self,
        owner: str,
        computer_ns: Callable[[], int] = time.time_ns,
        steady_ns: Callable[[], int] = host_time_ns,
    ) -> None:
        self._owner, self._computer_ns, self._steady_ns = owner, computer_ns, steady_ns
        self._reported_s = 0.0

    def report(self) -> str:
        """Return one line on a step since the last report; "" when there was none."""
        ahead_s = (self._computer_ns() - self._steady_ns()) * 1e-9
        moved_s = ahead_s - self._reported_s
        if abs(moved_s) <= SHORTEST_S:
            return ""
        self._reported_s = ahead_s
        return (
            f"the clock of the {self._owner}'s computer was set "
            f"{'forward' if moved_s > 0 else 'back'} by {abs(moved_s):.1f} s; everything goes on, "
            "and stamps and the dates of logs stay as they were until quadlab is started again"
        )
