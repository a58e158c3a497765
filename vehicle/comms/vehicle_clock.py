"""The comms process's estimate of the vehicle's clock.

The clock belongs to the microcontroller; comms sees only the stamps of ticks, some milliseconds old
when it reads them. The least delayed reading of the last seconds (the largest stamp minus monotonic
time) is the best one, and host time fills in between. The time of a sample on the line is known and
added: the estimate is behind the true clock by the smallest further delay seen, some 0.1 ms.
"""

from __future__ import annotations

from collections import deque

from vehicle_link import clock

WINDOW_NS = 5_000_000_000
"""Age, in ns, after which readings are dropped: 50 ppm of drift make 0.25 ms in it."""


class VehicleClock:
    """Clock that one thread updates and any thread reads.

    Args:
        line_ns: time of a sample on the line, from its stamp on.
    """

    def __init__(self, line_ns: int = 0) -> None:
        self._line_ns = line_ns
        # Until the first tick, the host's epoch, at which the vehicle's clock starts.
        self._offset_ns = clock.time_ns() - clock.monotonic_ns()
        self._readings: deque[tuple[int, int]] = deque()  # (read, offset), offsets falling
        self.started = False

    def observe(self, stamp_ns: int, read_ns: int) -> None:
        """Use the newest tick's stamp, read at this monotonic time."""
        readings, offset = self._readings, stamp_ns + self._line_ns - read_ns
        while readings and readings[-1][1] <= offset:
            readings.pop()
        readings.append((read_ns, offset))
        while readings[0][0] < read_ns - WINDOW_NS:
            readings.popleft()
        self._offset_ns = readings[0][1]
        self.started = True

    def now_ns(self) -> int:
        """Return the vehicle's time, in ns."""
        return clock.monotonic_ns() + self._offset_ns

    def at_ns(self, monotonic_ns: int) -> int:
        """Return the vehicle's time, in ns, at a monotonic time."""
        return monotonic_ns + self._offset_ns
