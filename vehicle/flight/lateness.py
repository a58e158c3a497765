"""The lateness of the loop: statistics over about one second of samples.

Stamps come from the microcontroller's clock and the loop reads the host's; their difference is a
constant plus drift plus the lateness. The constant is taken as the smallest difference over this
second and the one before: over a longer time a drift of 50 ppm would look like lateness.

`BOUNDS_NS` is also documented in quadlab_msgs/VehicleStatus.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

SECOND_NS = 1_000_000_000
CAPACITY = 2048  # samples a second at most
BOUNDS_NS = np.array([50, 100, 200, 500, 1000, 2000, 5000], np.int64) * 1000
"""Bounds between the bins of the histogram; the last bin has no upper bound."""


@dataclass(frozen=True, slots=True)
class LoopStatistics:
    """The statistics of the samples of one second; times in s."""

    rate: float  # ticks a second
    lateness_p50: float
    lateness_p99: float
    lateness_max: float
    missed_share: float  # 0..1


def new_histogram() -> npt.NDArray[np.uint32]:
    """Return an empty histogram: the number of ticks in each bin of lateness."""
    return np.zeros(len(BOUNDS_NS) + 1, np.uint32)


@dataclass(slots=True)
class LoopCounts:
    """The counts since the start of the loop."""

    lateness: npt.NDArray[np.uint32] = field(default_factory=new_histogram)  # ticks in each bin
    overruns: int = 0  # ticks that took longer than a period
    missed_frames: int = 0  # periods without a sample
    damaged_frames: int = 0  # runs of bytes that are not a frame


class Lateness:
    """Collector of one pair of times per tick; returns statistics once a second.

    Attributes:
        histogram: (8,) ticks by lateness since the start, updated once a second.
    """

    def __init__(self) -> None:
        self.histogram = new_histogram()
        self._stamps = np.zeros(CAPACITY + 1, np.int64)  # [0]: the last of the previous second
        self._offsets = np.zeros(CAPACITY, np.int64)
        self._count = 0
        self._start_ns = 0
        self._has_previous = False
        self._last_minimum = np.iinfo(np.int64).max

    def add(self, now_ns: int, stamp_ns: int) -> LoopStatistics | None:
        """Count one tick that began at `now_ns` (monotonic).

        Returns the statistics of the second that ended with the previous sample, else None.

        Args:
            stamp_ns: of its sample, by the vehicle's clock.
        """
        finished = None
        if self._count and (now_ns - self._start_ns >= SECOND_NS or self._count == CAPACITY):
            finished = self._finish(now_ns)
        if not self._count:
            self._start_ns = now_ns
        self._offsets[self._count] = now_ns - stamp_ns
        self._count += 1
        self._stamps[self._count] = stamp_ns
        return finished

    def _finish(self, now_ns: int) -> LoopStatistics:
        count, self._count = self._count, 0
        offsets = self._offsets[:count]
        offsets.sort()
        minimum = int(offsets[0])
        floor = min(minimum, self._last_minimum)
        self._last_minimum = minimum
        ends = np.append(offsets.searchsorted(floor + BOUNDS_NS), count)
        self.histogram += np.diff(ends, prepend=0).astype(np.uint32)
        period_ns, skipped = _gaps(self._stamps[0 if self._has_previous else 1 : count + 1])
        self._stamps[0], self._has_previous = self._stamps[count], True
        late = count - int(offsets.searchsorted(floor + period_ns, side="right"))
        return LoopStatistics(
            rate=count * SECOND_NS / (now_ns - self._start_ns),
            lateness_p50=float(offsets[count // 2] - floor) * 1e-9,
            lateness_p99=float(offsets[(count * 99) // 100] - floor) * 1e-9,
            lateness_max=float(offsets[-1] - floor) * 1e-9,
            # A period has no tick when its sample never arrived or arrived a period late.
            missed_share=(skipped + late) / (skipped + count) if period_ns else 0.0,
        )


def _gaps(stamps: npt.NDArray[np.int64]) -> tuple[int, int]:
    """Return the sample period (ns) and the number of samples missing between the first and last.

    Stamps are whole milliseconds, so the period is the mean of the ordinary differences; an
    ordinary one is up to 1.5 times their median (2 and 3 ms alternate at 400 Hz).
    """
    if len(stamps) < 3:
        return 0, 0
    steps = stamps[1:] - stamps[:-1]
    steps.sort()
    ordinary = int(steps.searchsorted(1.5 * steps[len(steps) // 2], side="right"))
    period = int(steps[:ordinary].sum()) / ordinary
    if period <= 0.0:
        return 0, 0
    skipped = sum(round(step / period) - 1 for step in steps[ordinary:].tolist())
    return round(period), skipped
