"""Topics and commands offered to a client: channels for topics, services for commands."""

from __future__ import annotations

from functools import cache

from extensions.foxglove.cones import TOPIC, TYPE
from extensions.foxglove.protocol import ENCODING
from quadrotor.json_object import JsonObject
from vehicle_link.commands import COMMANDS
from vehicle_link.messages import definition, ros_name
from vehicle_link.topics.rmw_keys import full_name
from vehicle_link.topics.table import SERVICES, TOPICS

INNER = ("sweeps", "ticks", "stick", "presence")
"""Topics that say nothing that another one does not say, and those between page and station."""
CHANNELS = (
    *(
        name
        for name, row in TOPICS.items()
        # What the vehicle sends on the lane would arrive a second time over the radio.
        if not (row.sender == "vehicle" and row.lane) and name not in INNER
    ),
    TOPIC,
)
"""Topics by channel number; the last is made here."""
CALLED = (*(name for name, row in COMMANDS.items() if row.has_route), "mark", "control")
"""Commands by service number: those for which the page has a route."""
SCHEMA_ENCODING = "ros2msg"


@cache
def channels(vehicle: str) -> list[JsonObject]:
    """Return the channels in the form in which they are advertised."""
    return [
        {
            "id": number,
            "topic": full_name(f"/{vehicle}", name),
            "encoding": ENCODING,
            "schemaName": ros_name(_type_name(name)),
            "schema": definition(_type_name(name)),
            "schemaEncoding": SCHEMA_ENCODING,
        }
        for number, name in enumerate(CHANNELS)
    ]


@cache
def services(vehicle: str) -> list[JsonObject]:
    """Return the services as they are advertised, with schemas for older clients too."""
    return [
        {
            "id": number,
            "name": f"/{vehicle}/{name}",
            "type": SERVICES[name],
            **{part.lower(): _described(name, part) for part in ("Request", "Response")},
            **{f"{p.lower()}Schema": _text(name, p) for p in ("Request", "Response")},
        }
        for number, name in enumerate(CALLED)
    ]


def _type_name(topic: str) -> str:
    return TYPE if topic == TOPIC else TOPICS[topic].type_name


def _described(service: str, part: str) -> dict[str, str]:
    return {
        "encoding": ENCODING,
        "schemaName": f"{SERVICES[service]}_{part}",
        "schemaEncoding": SCHEMA_ENCODING,
        "schema": _text(service, part),
    }


def _text(service: str, part: str) -> str:
    return definition(f"{SERVICES[service]}_{part}")
