"""The vehicle's clock: the microcontroller's milliseconds, unwrapped, from a host epoch.

The microcontroller sends its time in ms modulo 60 s. The vehicle's clock is that time counted on
without wrapping, plus a constant: the host's epoch time at which the first sample was taken. A
sample can only arrive late, so the constant is the least (arrival - elapsed) over the first
samples; those are spent on it. In simulated time the constant is given, usually 0.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from vehicle_link.serial.ids import TIME_PERIOD_MS

SETTLING_SAMPLES = 50
LATE_MS = 1_000
"""A step that looks like 59 s to 60 s forward is a sample that came late by up to 1 s."""
JUMP_MS = 500
"""A longer step forward is believed only when a second sample confirms it."""
MS = 1_000_000


class MicrocontrollerClock:
    """Turns the microcontroller's wrapped ms into ns of the vehicle's clock.

    Args:
        epoch_ns: stamp of the first sample; None takes it from the host's clock.
        host_ns: the host's clock, read only until the epoch is settled.
    """

    def __init__(
        self, epoch_ns: int | None = None, host_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self._host_ns = host_ns
        self._epoch_ns = epoch_ns
        self._settling = 0
        self._least_ns: int | None = None
        self._last_ms: int | None = None
        self._elapsed_ms = 0
        self._suspect_ms: int | None = None

    @property
    def settled(self) -> bool:
        """Whether stamps can be given; until then samples only serve to find the epoch."""
        return self._epoch_ns is not None

    def elapsed_ns(self, ms: int) -> int | None:
        """Time of a sample since the first one; None when its time is not believed (yet).

        A gap of the samples longer than 60 s is taken modulo 60 s.
        """
        last = self._last_ms
        if last is None:
            self._last_ms = ms
            return 0
        step = (ms - last) % TIME_PERIOD_MS
        if step > TIME_PERIOD_MS - LATE_MS:
            return (self._elapsed_ms + step - TIME_PERIOD_MS) * MS
        if step > JUMP_MS and not self._confirmed(ms):
            self._suspect_ms = ms
            return None
        self._suspect_ms = None
        self._last_ms = ms
        self._elapsed_ms += step
        return self._elapsed_ms * MS

    def stamp_ns(self, elapsed_ns: int) -> int:
        """The vehicle's time; only once settled."""
        assert self._epoch_ns is not None
        return self._epoch_ns + elapsed_ns

    def settle(self, newest_elapsed_ns: int, samples: int) -> None:
        """Use one batch of samples, the newest `newest_elapsed_ns` old, to find the epoch."""
        least_ns = self._host_ns() - newest_elapsed_ns
        self._least_ns = least_ns if self._least_ns is None else min(self._least_ns, least_ns)
        self._settling += samples
        if self._settling >= SETTLING_SAMPLES:
            self._epoch_ns = self._least_ns

    def _confirmed(self, ms: int) -> bool:
        suspect = self._suspect_ms
        return suspect is not None and (ms - suspect) % TIME_PERIOD_MS <= JUMP_MS
