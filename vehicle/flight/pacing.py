"""The timing of the flight loop by absolute deadlines, for serial ports and for memory.

Sample k is due at start + k periods of the host's steady clock. On serial ports its bytes wake the
loop; in memory nothing does, so the loop sleeps until then. A sample that has not arrived one
period after it was due is a missed frame.
"""

from __future__ import annotations

import select
import time
from collections.abc import Sequence
from typing import Protocol

from vehicle_link import clock

POLL_MS = 50
DRIFT = 10_000
"""Relative difference between the microcontroller's and the host's clock: 100 ppm."""
GIVE_UP_NS = 1_000_000_000
"""Delay, in ns, from which samples are skipped, not caught up: the machine was suspended."""


class Deadlines:
    """Counter of the periods without a sample, by the deadlines that pass.

    A sample is due at its stamp plus the least delay of any sample so far, which follows the drift
    of the two clocks.

    Attributes:
        overdue_ns: when the next sample is overdue (steady clock), None before the first one.
        missed: number of periods without a sample so far.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.overdue_ns: int | None = None
        self.missed = 0
        self._stamp_ns = self._delay_ns = 0
        self._passed = 0  # deadlines passed since the last sample

    def met(self, stamp_ns: int, now_ns: int) -> None:
        """Note that the tick for the sample of `stamp_ns` (vehicle's clock) began at `now_ns`."""
        period_ns, delay_ns = self.period_ns, now_ns - stamp_ns
        if self.overdue_ns is None:
            self._delay_ns = delay_ns
        else:
            elapsed_ns = stamp_ns - self._stamp_ns
            least_ns = self._delay_ns = min(delay_ns, self._delay_ns + elapsed_ns // DRIFT)
            missed = max(0, (elapsed_ns - period_ns // 2) // period_ns)
            missed += delay_ns - least_ns > period_ns
            if missed > self._passed:
                self.missed += missed - self._passed
        self._passed = 0
        self._stamp_ns = stamp_ns
        self.overdue_ns = stamp_ns + self._delay_ns + 2 * period_ns

    def check(self, now_ns: int) -> None:
        """Count the deadlines that passed without a sample."""
        if self.overdue_ns is not None and now_ns >= self.overdue_ns:
            passed = 1 + (now_ns - self.overdue_ns) // self.period_ns
            self._passed += passed
            self.missed += passed
            self.overdue_ns += passed * self.period_ns


class Pacer(Protocol):
    """Timing of the loop: waits for the next sample."""

    deadlines: Deadlines

    def wait(self) -> None:
        """Wait until bytes may be readable, or the next sample is overdue."""


class Ports(Protocol):
    """The part of vehicle.boards.board.Board that is used here."""

    @property
    def lost_ports(self) -> int: ...

    def filenos(self) -> Sequence[int]: ...


class PortPacer:
    """Pacer that waits for bytes of the board's ports, `poll_ms` at most."""

    def __init__(self, ports: Ports, period_ns: int, poll_ms: int = POLL_MS) -> None:
        self._poll_ms = poll_ms
        self.deadlines = Deadlines(period_ns)
        self._ports = ports
        self._listen()

    def wait(self) -> None:
        if self._ports.lost_ports != self._lost_ports:
            self._listen()
        timeout_ms, overdue_ns = self._poll_ms, self.deadlines.overdue_ns
        if overdue_ns is not None:
            left_ns = overdue_ns - clock.monotonic_ns()
            timeout_ms = max(0, min(timeout_ms, -(-left_ns // 1_000_000)))
        self._poll.poll(timeout_ms)

    def _listen(self) -> None:
        """Poll only the remaining ports: a lost one would wake the loop forever."""
        self._lost_ports = self._ports.lost_ports
        self._poll = select.poll()
        for descriptor in self._ports.filenos():
            self._poll.register(descriptor, select.POLLIN)


class Robot(Protocol):
    """A simulated vehicle that is stepped in memory."""

    @property
    def stamp_ns(self) -> int:
        """Return the stamp of the newest sample in ns, since the first."""

    def step(self) -> None:
        """Make the next sample."""

    def skip(self, samples: int) -> None:
        """Skip this many samples."""


class MemoryPacer:
    """Pacer that generates each sample before it is due, then sleeps until then.

    Args:
        start_ns: when the first sample is due, on the host's steady clock.

    Attributes:
        due_ns: when the present sample was due.
    """

    def __init__(self, robot: Robot, period_ns: int, start_ns: int) -> None:
        self.deadlines = Deadlines(period_ns)
        self.due_ns = start_ns
        self._robot = robot
        self._start_ns = start_ns

    def wait(self) -> None:
        behind_ns = time.monotonic_ns() - self.due_ns
        if behind_ns > GIVE_UP_NS:
            self._robot.skip(behind_ns // self.deadlines.period_ns)
        self._robot.step()
        self.due_ns = self._start_ns + self._robot.stamp_ns
        left_ns = self.due_ns - time.monotonic_ns()
        if left_ns > 0:
            time.sleep(left_ns * 1e-9)
