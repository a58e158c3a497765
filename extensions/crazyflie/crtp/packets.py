"""CRTP packets, and their frames on links that carry bytes.

A packet is one header byte, port in the upper and channel in the lower half, and up to 30 bytes of
data; numbers are little-endian. Radio and UDP keep packets apart. Where bytes are carried, a packet
is framed: start byte, length, packet, sum of these bytes modulo 256; damage costs one frame.

Facts: https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master (functional areas,
CRTP).
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum

import msgspec

from quadrotor.errors import OutOfBoundsError

START = 0xBC
DATA_MAX = 30
NULL = b"\xff"
"""The packet without a meaning, which is sent to poll for packets of the other end."""


class CrtpPort(IntEnum):
    """Numbers of the subsystems."""

    CONSOLE = 0
    PARAMETERS = 2
    COMMANDER = 3
    MEMORY = 4
    LOG = 5
    LOCALIZATION = 6
    SETPOINT = 7  # generic set-points
    SUPERVISOR = 9
    PLATFORM = 13
    LINK = 15


class Packet(msgspec.Struct, frozen=True):
    """One packet."""

    port: int
    channel: int
    data: bytes = b""

    @property
    def is_null(self) -> bool:
        return self.port == CrtpPort.LINK and self.channel == 3

    def encode(self) -> bytes:
        """Return header and data. Raises OutOfBoundsError for more than 30 bytes of data."""
        if len(self.data) > DATA_MAX:
            raise OutOfBoundsError(
                f"CRTP packet {self.port}:{self.channel} has {len(self.data)} bytes; "
                f"at most {DATA_MAX} can be sent"
            )
        return bytes((self.port << 4 | self.channel,)) + self.data


def decode(packet: bytes) -> Packet:
    """Return the packet of at least one byte; the two reserved bits are ignored."""
    return Packet(packet[0] >> 4, packet[0] & 3, packet[1:])


def frame(packet: bytes) -> bytes:
    """Return the frame of an encoded packet."""
    body = bytes((START, len(packet))) + packet
    return body + bytes((sum(body) & 0xFF,))


class FrameReader:
    """Decoder that finds the packets in a stream of bytes.

    Attributes:
        damaged: number of runs of bytes that are not frames.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._waiting = b""
        self._in_damage = False

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the encoded packets that these bytes complete."""
        self._waiting += data
        while len(self._waiting) >= 2:
            length = self._waiting[1]
            if self._waiting[0] != START or not 1 <= length <= DATA_MAX + 1:
                self._skip()
                continue
            end = 2 + length
            if len(self._waiting) <= end:
                return
            if sum(self._waiting[:end]) & 0xFF != self._waiting[end]:
                self._skip()
                continue
            packet = self._waiting[2:end]
            self._waiting, self._in_damage = self._waiting[end + 1 :], False
            yield packet

    def _skip(self) -> None:
        at = self._waiting.find(START, 1)
        self._waiting = self._waiting[at:] if at > 0 else b""
        self.damaged += not self._in_damage
        self._in_damage = True
