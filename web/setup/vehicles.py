"""The vehicles this station knows: the one it is set up for, and those of its runs."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from console.catalogue import Catalogue, RunEntry
from web.live import Live

SCANNED = 1000
"""Newest runs in which vehicles are looked for."""


@dataclass(slots=True)
class KnownVehicle:
    name: str
    ours: bool  # this station dials it
    link: str  # good, degraded, lost; empty for another station's
    runs: int  # of the newest `SCANNED`
    last_seen: float | None  # s, epoch; of its newest run where it is not connected


def known_vehicles(
    name: str, live: Live, catalogue: Catalogue, now: float
) -> list[dict[str, object]]:
    """Ours first. `now`: s, epoch. Raises StorageError."""
    age = live.age("status")
    link = live.current("link_status")
    ours = KnownVehicle(
        name, True, str(link.state) if link else "", 0, now - age if math.isfinite(age) else None
    )
    found = {name: ours}
    for run in catalogue.runs(limit=SCANNED):
        known = found.setdefault(run.vehicle, KnownVehicle(run.vehicle, False, "", 0, None))
        known.runs += 1
        known.last_seen = max(known.last_seen or 0.0, _end(run))
    return [asdict(one) for one in found.values()]


def _end(run: RunEntry) -> float:
    return run.start_ns * 1e-9 + run.duration
