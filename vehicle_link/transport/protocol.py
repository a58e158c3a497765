"""A check whether the two ends of a link use the same message definitions.

Zenoh's keys contain the hash of each type, so ends with different definitions silently fail to
receive each other, topic by topic. The protocol is one hash over all of them, which both ends can
compare.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import re
from functools import cache

from quadrotor.checkout import DISTRIBUTION
from quadrotor.records import TICK
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import type_hash
from vehicle_link.topics.table import SERVICES, TOPICS

AT_STATION = {"mark", "experiment", "control", "transfer"} | {
    name for name, command in COMMANDS.items() if command.at != "vehicle"
}
"""Services that stay on the station's loopback, as its other topics do."""


@cache
def protocol() -> str:
    """Return eight hex digits: a hash of all definitions of topics and services on the radio."""
    rows = [f"tick {TICK.descr}"]  # the contents of telemetry are not a ROS type
    for row in TOPICS.values():
        if row.on_radio:
            rows.append(f"{row.name} {type_hash(row.type_name)}")
    for name, srv_type in SERVICES.items():
        if name not in AT_STATION:
            rows.append(f"{name} {type_hash(srv_type)}")
    return hashlib.sha256("\n".join(sorted(rows)).encode()).hexdigest()[:8]


@cache
def version() -> str:
    """Return the version of this software."""
    try:
        return importlib.metadata.version(DISTRIBUTION)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def disagreement(their_protocol: str, their_version: str) -> str:
    """Return why this station cannot understand a vehicle, and what to update; "" if it can."""
    if their_protocol == protocol():
        return ""
    ours, theirs = _number(version()), _number(their_version)
    remedy = "install the same version of quadlab on both"
    if ours and theirs and ours != theirs:
        remedy = f"update quadlab on the {'vehicle' if theirs < ours else 'station'}"
    return (
        f"the vehicle speaks protocol {their_protocol or 'unknown'} (quadlab "
        f"{their_version or 'unknown'}), this station {protocol()} (quadlab {version()}); {remedy}"
    )


def _number(text: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", text)[:3])
