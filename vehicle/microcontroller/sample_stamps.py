"""The times at which samples were taken, finer than the whole milliseconds of their stamps.

At 650 Hz the stamps are 1 and 2 ms apart in turns, and so would be the time steps of everything
that divides by them. The samples themselves are a period apart, which the flight stack has chosen.
"""

from __future__ import annotations

MS = 1_000_000


class FineStamps:
    """Args: `period_ns`, between two samples, as the microcontroller was asked for."""

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last_ns: int | None = None

    def refine(self, stamp_ns: int) -> int:
        """Return the time of the next sample, never off its stamp by a millisecond or more.

        Args: `stamp_ns`, rounded down to milliseconds, larger than any before.
        """
        last_ns, period_ns = self._last_ns, self._period_ns
        if last_ns is None:
            fine_ns = stamp_ns
        else:
            # Rounded up, with a tenth to spare: the stamp lacks what was below a millisecond.
            periods = max(1, (10 * (stamp_ns - last_ns) + 9 * period_ns) // (10 * period_ns))
            fine_ns = last_ns + periods * period_ns
            fine_ns = min(max(fine_ns, stamp_ns), stamp_ns + MS - 1)
        self._last_ns = fine_ns
        return fine_ns
