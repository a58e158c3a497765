"""A file on board that has something of a run's time, and what of it is compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from console.transfers.part_file import PartFile, Range
from console.transfers.vehicle_files import VehicleFile
from flight_log.fill_source import FillSource

EDGE_NS = 150_000_000
"""Ticks stand in the vehicle's log within so much of their stamps; and its chunks are shorter."""
TOGETHER_NS = 300_000_000
"""Holes closer than this are fetched as one."""
Span = tuple[int, int]
"""First and last, ns of the vehicle's clock."""


@dataclass
class Source:
    """One file on board that has something of the run's time.

    Attributes:
        spans: of which the run is compared, those fetched.
        count: ticks of the whole file by its index; None when it has none (yet), or when only a
            part of it is of the run's time.
    """

    file: VehicleFile
    part: PartFile
    spans: list[Span]
    ranges: list[Range] = field(default_factory=list)
    channels: dict[int, tuple[str, str]] = field(default_factory=dict)
    count: int | None = None

    @property
    def fetched(self) -> FillSource:
        """Return what was fetched of it, to fill the run from."""
        ranges = tuple(self.ranges)
        return FillSource(self.file.name, self.part.path, ranges, dict(self.channels))


def together(spans: Sequence[Span], gap: int = TOGETHER_NS) -> list[Span]:
    """Return the spans in order, with those that overlap or lie close joined."""
    joined: list[Span] = []
    for first, last in sorted(spans):
        if joined and first <= joined[-1][1] + gap:
            joined[-1] = (joined[-1][0], max(joined[-1][1], last))
        else:
            joined.append((first, last))
    return joined
