"""The authority of a parameter, and a change as it reports it."""

from __future__ import annotations

import msgspec

from quadrotor.parameter_description import ParameterValue


class ParameterChange(msgspec.Struct, frozen=True, tag="parameter_change"):
    """A change that an authority has applied.

    Attributes:
        instance: of the process that counts the revisions; 0 if unknown.
    """

    stamp_ns: int
    name: str
    old: ParameterValue
    new: ParameterValue
    requester: str
    revision: int
    instance: int = 0


VEHICLE, STATION, SIMULATOR = "vehicle", "station", "simulator"


def authority_of(name: str) -> str:
    """Return the authority of a name: the station for `station.…`, the simulator for `simulator.…`,
    the vehicle for all others.
    """
    first = name.partition(".")[0]
    return first if first in (STATION, SIMULATOR) else VEHICLE
