"""MSP v2 frames: `$X`, direction, flag, function, size, payload, CRC-8; numbers little-endian.

After damaged bytes the receiver searches for the next `$X`; each damage costs at most one frame.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator

import msgspec

from quadrotor.errors import OutOfBoundsError

POLYNOMIAL = 0xD5


def _entry(byte: int) -> int:
    for _ in range(8):
        byte = (byte << 1 ^ (POLYNOMIAL if byte & 0x80 else 0)) & 0xFF
    return byte


_TABLE = bytes(_entry(byte) for byte in range(256))


def crc8(data: bytes) -> int:
    """Return the checksum of bytes: polynomial 0xD5, initial value 0."""
    crc = 0
    for byte in data:
        crc = _TABLE[crc ^ byte]
    return crc


START = b"$X"
REQUEST, REPLY, ERROR = b"<", b">", b"!"
_DIRECTIONS = REQUEST, REPLY, ERROR
_HEAD = struct.Struct("<BHH")  # flag, function, size
_FRONT = len(START) + 1 + _HEAD.size
PAYLOAD_MAX = 512
"""Bytes; the firmware's own buffers are no longer than this, so a larger size is damage."""


class Message(msgspec.Struct, frozen=True):
    """One frame."""

    function: int
    payload: bytes = b""
    direction: bytes = REPLY


def encode(function: int, payload: bytes = b"", direction: bytes = REQUEST) -> bytes:
    """Return the frame of a function (0 to 65535). Raises OutOfBoundsError."""
    if not 0 <= function <= 0xFFFF or len(payload) > PAYLOAD_MAX:
        raise OutOfBoundsError(
            f"MSP function {function} with {len(payload)} bytes cannot be sent; allowed are 0 to "
            f"65535 with up to {PAYLOAD_MAX} bytes"
        )
    body = _HEAD.pack(0, function, len(payload)) + payload
    return START + direction + body + bytes((crc8(body),))


class MessageDecoder:
    """Decoder that finds frames in a stream of bytes.

    Attributes:
        damaged: number of runs of bytes that are not frames.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._waiting = b""
        self._in_damage = False

    def feed(self, data: bytes) -> Iterator[Message]:
        """Yield the frames that these bytes complete."""
        self._waiting += data
        while self._waiting:
            at = self._waiting.find(START[:1])
            if at:
                self._skip(at if at > 0 else len(self._waiting))
                continue
            waiting = self._waiting
            if not START.startswith(waiting[:2]) or waiting[2:3] not in (b"", *_DIRECTIONS):
                self._skip(1)
                continue
            if len(waiting) < _FRONT:
                return
            _, function, size = _HEAD.unpack_from(waiting, _FRONT - _HEAD.size)
            if size > PAYLOAD_MAX:
                self._skip(1)
                continue
            end = _FRONT + size
            if len(waiting) <= end:
                return
            if crc8(waiting[_FRONT - _HEAD.size : end]) != waiting[end]:
                self._skip(1)
                continue
            self._waiting, self._in_damage = waiting[end + 1 :], False
            yield Message(function, waiting[_FRONT:end], waiting[2:3])

    def _skip(self, count: int) -> None:
        self._waiting = self._waiting[count:]
        self.damaged += not self._in_damage
        self._in_damage = True
