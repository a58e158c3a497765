"""The vehicle's clock: the microcontroller's milliseconds, unwrapped, from a host epoch.

The microcontroller sends its time in ms modulo 60 s. The vehicle's clock is that time counted on
without wrapping, plus a constant: the host's epoch time at which the first sample was taken. A
sample can only arrive late, so the constant is the least (arrival - elapsed) over the first
samples, less the time its frame takes on the line; those are spent on it. In simulated time the
constant is given, usually 0.

The host's clock may be set while the vehicle runs, by an hour or by years. Once the epoch is
settled the host's time goes on by its steady clock, so that stamps neither jump nor stand still;
that it was set is told, once each time.
"""

from __future__ import annotations

from collections.abc import Callable

from vehicle_link import clock
from vehicle_link.serial.ids import TIME_PERIOD_MS
from vehicle_link.serial.port import BAUD_RATE

SETTLING_SAMPLES = 50
SETTLING_NS = 400_000_000
"""Between the first and the last of them: a busy machine may hold all bytes back for 0.3 s."""
LATE_MS = 1_000
"""A step that looks like 59 s to 60 s forward is a sample that came late by up to 1 s."""
JUMP_MS = 50
"""A longer step forward is believed only when a second sample confirms it: believed wrongly, every
true sample would be late until that time."""
SLACK_MS = 1_000
"""Such a step must not lead further ahead of the host's steady clock than ever before, but this."""
RESTART_MS = 1_000
"""Times refused for so long are those of a microcontroller that began anew."""
MS = 1_000_000
AHEAD_NS = 5_000_000
"""A sample that arrives so long before its own stamp shows that all the first ones came late."""
LATEST_NS = 2_000_000_000
"""First samples are not later than this: a clock further ahead is so by a fast microcontroller,
and set back it would give no sample for as long."""
SET_NS = 2_000_000_000
"""By less the host's clock is set for a leap second, or after a short time without a network."""
FRAME_NS = 34 * 1_000_000_000 // (BAUD_RATE // 10)
"""On the line, a `D` frame of 34 bytes."""


class MicrocontrollerClock:
    """Turns the microcontroller's wrapped ms into ns of the vehicle's clock.

    Args:
        epoch_ns: stamp of the first sample, for simulated time; None takes it from the host.
        host_ns: the host's clock; gives the epoch, and is only watched for being set afterwards.
        steady_ns: the host's steady clock, which tells a gap from a sample that came very late,
            and that the host's clock was set; not read when the epoch is given.
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
        self._ahead_of_steady_ns = 0  # the host's clock, when the epoch was settled
        self._told_ns = 0  # the same when last told
        self._lead_ms = 0  # largest so far of the clock before the host's
        self._refused_ms: int | None = None  # the host's time when the first was
        self._epoch_ns = epoch_ns
        self._settling = 0
        self._least_ns: int | None = None
        self._last_ms: int | None = None
        self._elapsed_ms = 0
        self._suspect_ms: int | None = None

    @property
    def settled(self) -> bool:
        """Return whether stamps can be given; until then samples only serve to find the epoch."""
        return self._epoch_ns is not None

    def elapsed_ns(self, ms: int) -> int | None:
        """Return time of a sample since the first one; None when its time is not believed (yet).

        A gap of the samples longer than 60 s is taken modulo 60 s.
        """
        last = self._last_ms
        if last is None:
            self._last_ms = ms
            self._begun_ns = self._steady_ns() if self._steady_ns is not None else 0
            return 0
        step = (ms - last) % TIME_PERIOD_MS
        if step > TIME_PERIOD_MS - LATE_MS:
            return (self._elapsed_ms + step - TIME_PERIOD_MS) * MS
        host = self._host_ms()
        if step > JUMP_MS:
            if host is not None and self._elapsed_ms + step > host + self._lead_ms + SLACK_MS:
                # More than a second late, or of another beginning: no such time has gone by.
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
            if self._steady_ns is not None:
                self._told_ns = self._ahead_of_steady_ns = self._host_over_steady(self._steady_ns)

    def correct(self, newest_elapsed_ns: int) -> float:
        """Set the clock back when it is ahead of the host's: all samples it was set by came late.

        Only while no one flies by it: stamps go back. Returns by how much, s.
        """
        if self._steady_ns is None or self._epoch_ns is None:
            return 0.0
        host_ns = self._steady_ns() + self._ahead_of_steady_ns
        ahead_ns = self._epoch_ns + FRAME_NS + newest_elapsed_ns - host_ns
        if not AHEAD_NS < ahead_ns <= LATEST_NS:
            return 0.0
        self._epoch_ns -= ahead_ns
        return ahead_ns * 1e-9

    def host_set(self) -> float:
        """Return by how much the host's clock was set forward (back: below 0) since the last
        report, s; else 0.

        The vehicle's clock does not follow: its stamps must not jump, and go back even less.
        """
        if self._steady_ns is None or self._epoch_ns is None:
            return 0.0
        now_ns = -self._steady_ns() + self._host_ns()
        set_ns = now_ns - self._told_ns
        if abs(set_ns) <= SET_NS:
            return 0.0
        self._told_ns = now_ns
        return set_ns * 1e-9

    def _host_over_steady(self, steady_ns: Callable[[], int]) -> int:
        """Read in this order a pause between the two makes it larger: the least is right."""
        return min(-steady_ns() + self._host_ns() for _ in range(3))

    def _host_ms(self) -> int | None:
        """Return the ms since the first sample by the host's clock; None in simulated time."""
        return None if self._steady_ns is None else (self._steady_ns() - self._begun_ns) // MS

    def _confirmed(self, ms: int) -> bool:
        suspect = self._suspect_ms
        return suspect is not None and (ms - suspect) % TIME_PERIOD_MS <= JUMP_MS
