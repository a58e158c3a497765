"""The datagram of a lane: a header, and a content that only the lane's ends can read or make.

    header   version 1 B | id of the keys 4 B | counter 8 B
    content  topic 1 B | publisher's sequence 8 B, source time 8 B, GID 16 B | payload
    tag      16 B

Little endian, times in ns. The header is authenticated; the content is encrypted as well, by
ChaCha20-Poly1305 (RFC 8439) with the counter as nonce: it is also fast on processors without AES.
"""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass

from vehicle_link.clock import time_ns
from vehicle_link.lane.replay_window import ReplayWindow
from vehicle_link.topics.rmw_keys import GID_SIZE
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.publisher import Received

VERSION = 0xD1
KEY_SIZE = 32
LARGEST = 1200
"""Largest datagram, in bytes, that passes every network unfragmented."""

HELLO = "hello"
"""Message of the station without payload, which shows the station's address and that it listens."""
A_HELLO = Received(b"", 0, 0, 0)
_ROWS = [row for row in TOPICS.values() if row.lane]
TO_STATION = tuple(row.name for row in _ROWS if row.sender == "vehicle")
TO_VEHICLE = (HELLO, *(row.name for row in _ROWS if row.sender == "station"))

_TOPICS = {0: HELLO} | {row.lane: row.name for row in _ROWS}
_NUMBERS = {name: number for number, name in _TOPICS.items()}
_HEADER = struct.Struct("<BIQ")
_NONCE = struct.Struct("<4xQ")
_CONTENT = struct.Struct(f"<BQq{GID_SIZE}s")
_TAG = 16
LARGEST_PAYLOAD = LARGEST - _HEADER.size - _CONTENT.size - _TAG
_SMALLEST = _HEADER.size + _CONTENT.size + _TAG


@dataclass
class Refused:
    """Counts of the datagrams that were dropped, by reason.

    Attributes:
        foreign: not of this version, size or key. forged: not made with the key.
        replayed: received before, or too old to judge. unexpected: of a topic not for this end.
    """

    foreign: int = 0
    forged: int = 0
    replayed: int = 0
    unexpected: int = 0

    @property
    def total(self) -> int:
        return self.foreign + self.forged + self.replayed + self.unexpected


class Sealer:
    """Maker of the datagrams of one direction; thread-safe.

    Args:
        key: 32 bytes, used by this object only, because its counter begins at 1.
    """

    def __init__(self, key_id: int, key: bytes) -> None:
        from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

        self._key_id = key_id
        self._encrypt = ChaCha20Poly1305(key).encrypt
        self._counter = itertools.count(1)  # `next` is atomic

    def seal(self, topic: str, message: Received) -> bytes:
        """Seal a message, at most LARGEST_PAYLOAD bytes of payload, into a datagram."""
        counter = next(self._counter)
        header = _HEADER.pack(VERSION, self._key_id, counter)
        content = _CONTENT.pack(_NUMBERS[topic], message.sequence, message.source_ns, message.gid)
        return header + self._encrypt(_NONCE.pack(counter), content + message.payload, header)


class Opener:
    """Reader of the datagrams of one direction; for one thread only.

    Args:
        topics: topics that may arrive in this direction.
        refused: counts of what is dropped.
    """

    def __init__(self, key: bytes, topics: tuple[str, ...], refused: Refused) -> None:
        from cryptography.exceptions import InvalidTag
        from cryptography.hazmat.primitives.ciphers.aead import ChaCha20Poly1305

        self._decrypt = ChaCha20Poly1305(key).decrypt
        self._invalid = InvalidTag
        self._topics, self._refused = topics, refused
        self._window = ReplayWindow()

    @property
    def newest(self) -> int:
        """Return the largest counter accepted, 0 before the first."""
        return self._window.newest

    def open(self, datagram: bytes) -> tuple[str, Received] | None:
        """Open a datagram to (topic, message); return None, and count it, when it is refused.

        Only for datagrams in which `key_id_of` has found the id of this key.
        """
        received_ns = time_ns()
        counter = _HEADER.unpack_from(datagram)[2]
        if not self._window.is_new(counter):
            self._refused.replayed += 1
            return None
        header = datagram[: _HEADER.size]
        try:
            content = self._decrypt(_NONCE.pack(counter), datagram[_HEADER.size :], header)
        except self._invalid:
            self._refused.forged += 1
            return None
        self._window.mark_received(counter)  # only now: a forged counter must not move the window
        number, sequence, source_ns, gid = _CONTENT.unpack_from(content)
        topic = _TOPICS.get(number, "")
        if topic not in self._topics:
            self._refused.unexpected += 1
            return None
        return topic, Received(content[_CONTENT.size :], sequence, source_ns, received_ns, gid)


def key_id_of(datagram: bytes) -> int | None:
    """Return the id of the keys that a datagram names; None when it is no datagram of a lane."""
    if not _SMALLEST <= len(datagram) <= LARGEST or datagram[0] != VERSION:
        return None
    key_id: int = _HEADER.unpack_from(datagram)[1]
    return key_id
