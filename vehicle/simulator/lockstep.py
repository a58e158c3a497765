"""Simulated time in lockstep: it waits for the flight tick, the station's poses and telemetry.

Before the plant advances, each part has processed its input, or is no further behind than it would
be on a separate computer. A part without progress for `PATIENCE_NS` of the computer's time has died
or hangs: time continues without it until it has caught up, and the flight has to cope with the
failure. A process that has ended is not waited for, as it might be restarted before that is
noticed. Time spent waiting is lost: afterwards simulated time continues at the computer's pace and
never faster, except to make up for a late wake-up.
"""

from __future__ import annotations

import contextlib
import os
import select
import time
from collections import deque
from collections.abc import Callable, Sequence

from vehicle.processes.rings import fence
from vehicle_link import clock
from vehicle_link.lockstep import (
    ANSWERED,
    COMMS_PROCESS,
    FLIGHT_PROCESS,
    LINES,
    SERVED,
    STATION,
    STATION_PROCESS,
    TRUTH,
    VEHICLE,
    words_of,
)
from vehicle_link.serial.commands import decode_data
from vehicle_link.serial.frames import FrameDecoder

PATIENCE_NS = 5_000_000_000
"""Longer than a busy machine delays a running part."""
CHECK_S, CHECK_SELDOM_S = 0.0002, 0.002
"""Time, in s, between two checks for late parts, at first and later, as checks take time too."""
MADE_UP_NS = 20_000_000
"""Delay, in ns, up to which time catches up, which no part notices; a longer one is lost."""
SERVED_BEHIND_NS = 2_000_000
"""Allowed age, in ns, of the bytes that flight has handled, for a polled board."""
TRUTH_BEHIND_NS, STATION_BEHIND_NS, VEHICLE_BEHIND_NS = 15_000_000, 30_000_000, 150_000_000
"""Allowed ages, in ns: of the truth handled by the station and of the station's data received by
comms (beyond the truth's period), and of the vehicle's data received by the station."""
WINDOW_NS, PUBLISH_EVERY_NS = 2_000_000_000, 250_000_000
"""Window of the real-time factor, and how often it is published, in ns."""
NEVER = -1

Say = Callable[[str], None]


class Line:
    """The samples of one serial line: flight has to answer the newest one it can read.

    Args:
        words: those of the vehicle in the clock's page.
    """

    def __init__(self, words: memoryview, line: int) -> None:
        self._words, self._at = words, ANSWERED + line
        self._decoder = FrameDecoder()
        self._expected = NEVER
        words[self._at] = NEVER

    def delivered(self, data: bytes) -> None:
        """Note that flight can read these bytes, possibly damaged."""
        for frame in self._decoder.feed(data):
            values = decode_data(frame)
            if values is not None:
                self._expected = values[0] & 0xFFFF

    def is_behind(self, now_ns: int) -> bool:
        return self._expected == NEVER or self._expected != self._words[self._at]


class Age:
    """Age limit: the data that a part has processed must not be older than `allowed_ns`."""

    def __init__(self, words: memoryview, at: int, allowed_ns: int) -> None:
        self._words, self._at, self._allowed_ns = words, at, allowed_ns
        words[at] = NEVER

    def is_behind(self, now_ns: int) -> bool:
        return now_ns - self._words[self._at] > self._allowed_ns


class Process:
    """One process that runs parts, identified by the page of the clock.

    Args:
        words: those of the vehicle in the page.
        at: index of the process id.
    """

    def __init__(self, name: str, words: memoryview, at: int) -> None:
        self.name = name
        self.is_end_told = False
        self._words, self._at = words, at
        self._id, self._descriptor = 0, NEVER

    def has_ended(self) -> bool:
        """Return whether it has run and ended, even if it has not been reaped yet."""
        named = self._words[self._at]
        if named != self._id:
            self.close()
            self.is_end_told = False
            with contextlib.suppress(ProcessLookupError):  # it has ended already
                self._descriptor = os.pidfd_open(named)
            self._id = named
        if self._descriptor == NEVER:
            return self._id != 0
        ready = select.poll()
        ready.register(self._descriptor, select.POLLIN)
        return bool(ready.poll(0))

    def close(self) -> None:
        if self._descriptor != NEVER:
            os.close(self._descriptor)
        self._descriptor = NEVER


class Awaited:
    """One part that time waits for while it is active and its `processes` run."""

    def __init__(self, name: str, part: Line | Age, *processes: Process) -> None:
        self.name, self.is_behind = name, part.is_behind
        self.is_active = False
        self._processes = processes

    def ended(self) -> Process | None:
        """Return one of its processes that has ended, if any."""
        return next((one for one in self._processes if one.has_ended()), None)


class LockstepPace:
    """Pace of one simulation by the page of the clock that this process follows (`clock.follow`).

    Args:
        vehicles: by name, as in the page.
        truth_period_ns: longest time between two truths.
        is_asked: whether the board gives samples only on request.
        say: called with a line about a part that is no longer waited for.
        wall_ns, sleep: the computer's clock and sleep.
    """

    def __init__(
        self,
        page: memoryview,
        vehicles: Sequence[str],
        truth_period_ns: int,
        say: Say,
        wall_ns: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
        is_asked: bool = False,
    ) -> None:
        self._page, self._say = page, say
        self._wall_ns, self._sleep = wall_ns, sleep
        self._awaited: list[Awaited] = []
        self._processes: list[Process] = []
        self.lines: dict[str, list[Line]] = {}
        for name in vehicles:
            words = words_of(page, name)
            if words is None:
                raise KeyError(name)
            self.lines[name] = lines = [Line(words, line) for line in range(LINES)]
            of = f" of {name}" if len(vehicles) > 1 else ""
            flight = Process(f"the flight process{of}", words, FLIGHT_PROCESS)
            comms = Process(f"the comms process{of}", words, COMMS_PROCESS)
            station = Process("the station", words, STATION_PROCESS)
            tracker = Age(words, TRUTH, truth_period_ns + TRUTH_BEHIND_NS)
            station_heard = Age(words, STATION, truth_period_ns + STATION_BEHIND_NS)
            vehicle_heard = Age(words, VEHICLE, VEHICLE_BEHIND_NS)
            self._processes += [flight, comms, station]
            of_board = [Age(words, SERVED, SERVED_BEHIND_NS)] if is_asked else lines
            self._awaited += [
                *(Awaited(flight.name, part, flight) for part in of_board),
                Awaited(f"the station's tracker{of}", tracker, station),
                Awaited(f"the station's data on board{of}", station_heard, station, comms),
                Awaited(f"telemetry at the station{of}", vehicle_heard, flight, comms, station),
            ]
        self._published: deque[tuple[int, int]] = deque()  # (wall, simulated)

    def begin(self) -> int:
        """Start controlling the clock and return its time."""
        now_ns = clock.monotonic_ns()
        self._page[clock.OFFSET] = now_ns - self._wall_ns()
        self.reach(now_ns)
        return now_ns

    def reach(self, due_ns: int) -> None:
        """Let the clock advance to this time, before which everything is done."""
        self._page[clock.LIMIT] = due_ns

    def wait(self, due_ns: int, shortest: float, is_over: Callable[[], bool]) -> None:
        """Wait until this time is reached and every process is ready for it, or `is_over`.

        Args:
            shortest: least pause (s), made in any case.
        """
        page, wall_ns = self._page, self._wall_ns
        left_ns = due_ns - wall_ns() - page[clock.OFFSET]
        self._sleep(max(left_ns * 1e-9, shortest))
        self._wait_for_all(due_ns, is_over)
        self._drop_delay(due_ns)
        self._publish_factor(due_ns)

    def _wait_for_all(self, due_ns: int, is_over: Callable[[], bool]) -> None:
        gone: list[Awaited] = []
        began_ns = self._wall_ns()
        for one in self._awaited:
            while one.is_behind(due_ns):
                if not one.is_active:
                    break
                if is_over():
                    return
                if one.ended() or self._wall_ns() - began_ns > PATIENCE_NS:
                    one.is_active = False
                    gone.append(one)
                    break
                waited = (self._wall_ns() - began_ns) * 1e-9
                self._sleep(min(max(CHECK_S, 0.2 * waited), CHECK_SELDOM_S))
                self._drop_delay(due_ns)
                self._publish_factor(due_ns)
            else:
                one.is_active = True
        lines = []
        for one in gone:
            process = one.ended()
            if process is None:
                lines.append(f"nothing from {one.name} for {PATIENCE_NS * 1e-9:g} s")
            elif not process.is_end_told:
                process.is_end_told = True
                lines.append(f"{process.name} has ended")
        if lines and not self._page[clock.STOPPING]:
            self._say(f"{', '.join(dict.fromkeys(lines))}; time continues without it")

    def close(self) -> None:
        """Release the observed processes."""
        for process in self._processes:
            process.close()

    def _drop_delay(self, due_ns: int) -> None:
        """Drop a delay that is too long to catch up with; the clock stops in the meantime."""
        late_ns = self._wall_ns() + self._page[clock.OFFSET] - due_ns
        if late_ns > MADE_UP_NS:
            self._page[clock.OFFSET] -= late_ns
            fence()

    def _publish_factor(self, now_ns: int) -> None:
        """Publish the real-time factor."""
        wall_ns, published = self._wall_ns(), self._published
        if published and wall_ns - published[-1][0] < PUBLISH_EVERY_NS:
            return
        published.append((wall_ns, now_ns))
        if len(published) > 1:
            elapsed_ns = wall_ns - published[0][0]
            factor = 1_000_000 * (now_ns - published[0][1]) // elapsed_ns
            self._page[clock.FACTOR] = max(factor, 1)  # 0 means that there is no simulation
        while wall_ns - published[0][0] > WINDOW_NS:
            published.popleft()
