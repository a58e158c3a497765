"""The times at which samples were taken, with a finer resolution than their stamps in ms.

At 650 Hz the stamps are alternately 1 and 2 ms apart, which would disturb every division by a time
step. The samples themselves are one period apart, which the flight stack has chosen.
"""

from __future__ import annotations

MS = 1_000_000


class FineStamps:
    """Stamps of samples, finer than their counter.

    Args:
        period_ns: the sample period requested from the microcontroller.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last_ns: int | None = None

    def refine(self, stamp_ns: int) -> int:
        """Return the time of the next sample, always within a millisecond of its stamp.

        Args:
            stamp_ns: stamp rounded down to milliseconds, larger than any before.
        """
        last_ns, period_ns = self._last_ns, self._period_ns
        if last_ns is None:
            fine_ns = stamp_ns
        else:
            # Rounded up with a margin of a tenth: the stamp was rounded down.
            periods = max(1, (10 * (stamp_ns - last_ns) + 9 * period_ns) // (10 * period_ns))
            fine_ns = last_ns + periods * period_ns
            fine_ns = min(max(fine_ns, stamp_ns), stamp_ns + MS - 1)
        self._last_ns = fine_ns
        return fine_ns
