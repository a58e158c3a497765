"""Vehicles known to this station: configured, enrolled, or found in its runs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from console.catalogue.catalogue import Catalogue
from console.catalogue.tables import RunEntry
from console.link.known_vehicles import KnownVehicles
from web.latest import Live

SCANNED = 1000
"""Number of newest runs that are searched for vehicles."""


@dataclass(slots=True)
class KnownVehicle:
    name: str
    ours: bool  # this station connects to it
    link: str  # good, degraded, lost; empty for a vehicle of another station
    runs: int  # of the newest `SCANNED`
    last_seen: float | None  # s, epoch; of its newest run where it is not connected
    address: str = ""  # where it was enrolled (`quadlab link enrol`)


def known_vehicles(
    dialled: Mapping[str, Live], catalogue: Catalogue, now: float
) -> list[dict[str, object]]:
    """Return the known vehicles, this station's first. Raises StorageError.

    Args:
        dialled: the newest messages of each vehicle of this station, by name.
        now: s, epoch.
    """
    found = {}
    for name, live in dialled.items():
        age, link = live.age("status"), live.current("link_status")
        seen = now - age if math.isfinite(age) else None
        found[name] = KnownVehicle(name, True, str(link.state) if link else "", 0, seen)
    for run in catalogue.runs(limit=SCANNED):
        known = found.setdefault(run.vehicle, KnownVehicle(run.vehicle, False, "", 0, None))
        known.runs += 1
        known.last_seen = max(known.last_seen or 0.0, _end(run))
    for enrolled in KnownVehicles(catalogue.folder.parent).all().values():
        empty = KnownVehicle(enrolled.name, False, "", 0, None)
        found.setdefault(enrolled.name, empty).address = enrolled.address
    return [asdict(one) for one in found.values()]


def _end(run: RunEntry) -> float:
    return run.start_ns * 1e-9 + run.duration
