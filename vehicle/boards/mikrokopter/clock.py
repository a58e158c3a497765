"""The vehicle's clock: the microcontroller's milliseconds, unwrapped, from a host epoch.

The microcontroller sends its time in ms modulo 60 s. The vehicle's clock is that time without
wrapping, plus a constant: the host's epoch time at which the first sample was taken. A sample can
only arrive late, so the constant is the least (arrival - elapsed) over the first samples, less the
time a frame takes on the line; these samples are used for nothing else. In simulated time the
constant is given, usually 0.

The host's clock may be set while the vehicle runs, by an hour or by years: the host's time is that
of `vehicle_link.clock`, which continues by the steady clock, so that stamps neither jump nor stop.
"""

from __future__ import annotations

from collections.abc import Callable

from vehicle_link import clock
from vehicle_link.serial.ids import TIME_PERIOD_MS
from vehicle_link.serial.port import BAUD_RATE

SETTLING_SAMPLES = 50
SETTLING_NS = 400_000_000
"""Shortest time, in ns, between the first and the last: a busy machine may delay bytes by 0.3 s."""
LATE_MS = 1_000
"""A step that appears to be 59 s to 60 s forward is a sample that is late by up to this many ms."""
JUMP_MS = 50
"""Longest step, in ms, that is accepted at once; a longer one needs a second sample to confirm it,
as after a wrong one every true sample would be late until that time."""
SLACK_MS = 1_000
"""Amount, in ms, by which a step over JUMP_MS may exceed the largest lead over the host's steady
clock so far."""
RESTART_MS = 1_000
"""Times refused for this long mean that the microcontroller was restarted."""
MS = 1_000_000
AHEAD_NS = 5_000_000
"""A sample that arrives this long before its own stamp shows that all the first ones were late."""
LATEST_NS = 2_000_000_000
"""The first samples are not later than this: a clock further ahead means a fast microcontroller,
and setting it back would drop all samples for as long."""
FRAME_NS = 34 * 1_000_000_000 // (BAUD_RATE // 10)
"""Time of a `D` frame of 34 bytes on the line."""


class MicrocontrollerClock:
    """Conversion of the microcontroller's wrapped ms to ns of the vehicle's clock.

    Args:
        epoch_ns: stamp of the first sample, for simulated time; None uses the host's time.
        host_ns: the host's clock, which gives the epoch.
        steady_ns: the host's steady clock, which distinguishes a gap from a very late sample; not
            read when the epoch is given.
    """

    def __init__(
        self,
        epoch_ns: int | None = None,
        host_ns: Callable[[], int] = clock.time_ns,
        steady_ns: Callable[[], int] = clock.monotonic_ns,
    ) -> None:
        self._host_ns = host_ns
        self._steady_ns = steady_ns if epoch_ns is None else None
        self._begun_ns = 0
        self._lead_ms = 0  # largest lead over the host's clock so far
        self._refused_ms: int | None = None  # the host's time at the first refusal
        self._epoch_ns = epoch_ns
        self._settling = 0
        self._least_ns: int | None = None
        self._last_ms: int | None = None
        self._elapsed_ms = 0
        self._suspect_ms: int | None = None

    @property
    def settled(self) -> bool:
        """Return whether stamps are available; until then samples only serve to find the epoch."""
        return self._epoch_ns is not None

    def elapsed_ns(self, ms: int) -> int | None:
        """Return the time of a sample since the first one; None when it is not accepted (yet).

        A gap between samples longer than 60 s counts modulo 60 s.
        """
        last = self._last_ms
        if last is None:
            self._last_ms = ms
            self._begun_ns = self._steady_ns() if self._steady_ns is not None else 0
            return 0
        step = (ms - last) % TIME_PERIOD_MS
        if step > TIME_PERIOD_MS - LATE_MS:
            return (self._elapsed_ms + step - TIME_PERIOD_MS) * MS
        # ms since the first sample by the host's clock; None in simulated time
        host = None if self._steady_ns is None else (self._steady_ns() - self._begun_ns) // MS
        if step > JUMP_MS:
            if host is not None and self._elapsed_ms + step > host + self._lead_ms + SLACK_MS:
                # More than a second late, or from before a restart: no such time has passed.
                self._refused_ms = host if self._refused_ms is None else self._refused_ms
                if host - self._refused_ms < RESTART_MS:
                    return None
                step = max(0, host - self._elapsed_ms)
            elif not self._confirmed(ms):
                self._suspect_ms = ms
                return None
        self._suspect_ms = self._refused_ms = None
        self._last_ms = ms
        self._elapsed_ms += step
        if host is not None:
            self._lead_ms = max(self._lead_ms, self._elapsed_ms - host)
        return self._elapsed_ms * MS

    def stamp_ns(self, elapsed_ns: int) -> int:
        """Return the vehicle's time in ns; only once settled."""
        assert self._epoch_ns is not None
        return self._epoch_ns + elapsed_ns

    def settle(self, newest_elapsed_ns: int, samples: int) -> None:
        """Use one batch of samples, the newest `newest_elapsed_ns` old, to find the epoch."""
        least_ns = self._host_ns() - newest_elapsed_ns
        self._least_ns = least_ns if self._least_ns is None else min(self._least_ns, least_ns)
        self._settling += samples
        if self._settling >= SETTLING_SAMPLES and newest_elapsed_ns >= SETTLING_NS:
            self._epoch_ns = self._least_ns - FRAME_NS

    def correct(self, newest_elapsed_ns: int) -> float:
        """Set the clock back when it is ahead of the host's: all samples that set it were late.

        Call it on the ground only, as stamps go back. Returns by how much, s.
        """
        if self._steady_ns is None or self._epoch_ns is None:
            return 0.0
        ahead_ns = self._epoch_ns + FRAME_NS + newest_elapsed_ns - self._host_ns()
        if not AHEAD_NS < ahead_ns <= LATEST_NS:
            return 0.0
        self._epoch_ns -= ahead_ns
        return ahead_ns * 1e-9

    def _confirmed(self, ms: int) -> bool:
        suspect = self._suspect_ms
        return suspect is not None and (ms - suspect) % TIME_PERIOD_MS <= JUMP_MS
