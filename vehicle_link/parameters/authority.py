"""The authority of a parameter, by its name: each authority counts its own revisions."""

from __future__ import annotations

VEHICLE, STATION, SIMULATOR = "vehicle", "station", "simulator"


def authority_of(name: str) -> str:
    """Return the authority of a name: the station for `station.…`, the simulator for `simulator.…`,
    the vehicle for all others.
    """
    first = name.partition(".")[0]
    return first if first in (STATION, SIMULATOR) else VEHICLE
