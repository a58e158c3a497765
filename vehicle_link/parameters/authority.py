"""The authority of a parameter, by its name: each authority counts revisions of its own."""

from __future__ import annotations

VEHICLE, STATION, SIMULATOR = "vehicle", "station", "simulator"


def authority_of(name: str) -> str:
    """Return the authority of a name: `station.…` is the station's, `simulator.…` the simulated
    robot's, the rest the vehicle's.
    """
    first = name.partition(".")[0]
    return first if first in (STATION, SIMULATOR) else VEHICLE
