"""Names of vehicles on the command line, and the addresses that belong to them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from quadrotor.errors import UsageError

THE_VEHICLE = "quad1"


def check_name(name: str) -> None:
    """Check that a vehicle's name can be a topic namespace and a part of file names. Raises
    UsageError.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]{0,31}", name):
        raise UsageError(
            f"--name {name!r} is not a valid name; allowed are up to 32 lower-case letters, digits "
            "and _, a letter first, like quad2"
        )


def parse_names(words: Sequence[str]) -> tuple[str, ...]:
    """Return the names of vehicles, the default one if none is given. Raises UsageError."""
    for name in words:
        check_name(name)
        if words.count(name) > 1:
            raise UsageError(f"--name {name} is given twice")
    return tuple(words) or (THE_VEHICLE,)


def parse_vehicles(words: Sequence[str], name: str = THE_VEHICLE) -> dict[str, str]:
    """Return `name=host:port` words as {name: endpoint}; a word without a name gets `name`. Raises
    UsageError.
    """
    from vehicle_link.addresses import parse_endpoint

    found: dict[str, str] = {}
    for word in words:
        given, equals, endpoint = word.rpartition("=")
        one = given if equals else name
        check_name(one)
        if one in found:
            raise UsageError(
                f"two vehicles would be called {one!r}; "
                "give each its own name, like --vehicle quad2=192.168.4.3:7447"
            )
        place = parse_endpoint(endpoint)
        for other, there in found.items():
            if parse_endpoint(there) == place:
                raise UsageError(f"{other} and {one} would both be the vehicle at {endpoint}")
        found[one] = endpoint
    return found
