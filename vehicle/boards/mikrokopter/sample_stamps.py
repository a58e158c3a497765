"""The times at which samples were taken, with a finer resolution than their stamps in ms.

At 650 Hz the stamps are alternately 1 and 2 ms apart, which would disturb every division by a time
step. The samples themselves are one period apart, which the flight stack has chosen.
"""

from __future__ import annotations

import msgspec

from vehicle.boards.board import RawSample

MS = 1_000_000


class FineStamps:
    """Stamps of samples, finer than their counter.

    Args:
        period_ns: the sample period requested from the microcontroller.

    Attributes:
        late: number of samples dropped because they were older than the newest one.
    """

    def __init__(self, period_ns: int) -> None:
        self._period_ns = period_ns
        self._last_ns: int | None = None
        self._newest_ns = -1
        self.late = 0

    def in_order(self, samples: list[RawSample]) -> list[RawSample]:
        """Return the samples with fine stamps, oldest first, without the late ones."""
        samples.sort()
        kept = []
        for sample in samples:
            if sample.stamp_ns <= self._newest_ns:
                self.late += 1
                continue
            self._newest_ns = sample.stamp_ns
            stamp_ns = self.refine(sample.stamp_ns)
            same = stamp_ns == sample.stamp_ns  # always, at a period of whole milliseconds
            kept.append(sample if same else msgspec.structs.replace(sample, stamp_ns=stamp_ns))
        return kept

    def refine(self, stamp_ns: int) -> int:
        """Return the time of the next sample, always within a millisecond of its stamp.

        Args:
            stamp_ns: stamp rounded down to milliseconds, larger than any before.
        """
        last_ns, period_ns = self._last_ns, self._period_ns
        if last_ns is None or stamp_ns - last_ns == period_ns:
            fine_ns = stamp_ns
        else:
            # Rounded up with a margin of a tenth: the stamp was rounded down.
            periods = max(1, (10 * (stamp_ns - last_ns) + 9 * period_ns) // (10 * period_ns))
            fine_ns = last_ns + periods * period_ns
            fine_ns = min(max(fine_ns, stamp_ns), stamp_ns + MS - 1)
        self._last_ns = fine_ns
        return fine_ns
