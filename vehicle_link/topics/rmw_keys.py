"""Keys, tokens and attachments with which ROS 2 nodes (rmw_zenoh) recognise our traffic.

They follow rmw_zenoh's design notes; the tests compare with keys captured from a live rmw_zenoh.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

import xxhash

from vehicle_link.messages import dds_name, type_hash

GID_SIZE = 16
_ATTACHMENT = struct.Struct(f"<qqB{GID_SIZE}s")  # sequence, source time, length of GID, GID

EntityKind = Literal["MP", "MS", "SS", "SC"]
"""Publisher, subscription, service server, service client."""


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service as ROS 2 announces it; lifespans, deadlines and leases stay infinite."""

    reliable: bool = True
    latched: bool = False  # transient local
    depth: int = 10

    @property
    def text(self) -> str:
        """Return the text in liveliness tokens: a field is empty where it is rmw_zenoh's
        default.
        """
        depth = "" if self.depth == 42 else str(self.depth)
        reliability, durability = "" if self.reliable else "2", "1" if self.latched else ""
        return f"{reliability}:{durability}:,{depth}:,:,:,,"


RELIABLE = Qos()
SENSOR_DATA = Qos(reliable=False, depth=5)


@dataclass(frozen=True, slots=True)
class NodeIdentity:
    """One node in one session; `namespace` has a leading slash or is empty."""

    zid: str
    nid: int
    namespace: str
    name: str
    domain: int = 0

    @property
    def token(self) -> str:
        return f"{self._head(self.nid, 'NN')}/%/{_part(self.namespace)}/{self.name}"

    def endpoint_token(
        self, eid: int, kind: EntityKind, topic: str, type_name: str, qos: Qos
    ) -> str:
        """Return the liveliness key of a publisher, subscription, server or client."""
        return (
            f"{self._head(eid, kind)}/%/{_part(self.namespace)}/{self.name}/{_part(topic)}"
            f"/{dds_name(type_name)}/{type_hash(type_name)}/{qos.text}"
        )

    def _head(self, eid: int, kind: str) -> str:
        return f"@ros2_lv/{self.domain}/{self.zid}/{self.nid}/{eid}/{kind}"


def data_key(domain: int, topic: str, type_name: str) -> str:
    """Return the Zenoh key of a topic or service with the full name `topic` (`/quad1/state`)."""
    return f"{domain}/{topic.strip('/')}/{dds_name(type_name)}/{type_hash(type_name)}"


def full_name(namespace: str, name: str) -> str:
    """Return the full name: `state` in `/quad1` → `/quad1/state`; `/state` → `/state`."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def gid_of(token: str) -> bytes:
    """Return 16 bytes: XXH3-128 of the liveliness key, low half first, each little endian."""
    digest = xxhash.xxh3_128_intdigest(token.encode())
    return digest.to_bytes(GID_SIZE, "little")


def attachment(sequence: int, source_ns: int, gid: bytes) -> bytes:
    """Return the attachment of 33 bytes, without which rmw_zenoh drops a sample."""
    return _ATTACHMENT.pack(sequence, source_ns, GID_SIZE, gid)


def parse_attachment(data: bytes) -> tuple[int, int, bytes]:
    """Return (sequence, source time in ns, GID). Raises ValueError for anything else."""
    if len(data) != _ATTACHMENT.size:
        raise ValueError(f"an attachment has {_ATTACHMENT.size} bytes, not {len(data)}")
    sequence, source_ns, length, gid = _ATTACHMENT.unpack(data)
    if length != GID_SIZE:
        raise ValueError(f"the attachment's GID has {length} bytes instead of {GID_SIZE}")
    return sequence, source_ns, gid


def _part(name: str) -> str:
    return name.replace("/", "%") or "%"
