"""Bytes to frames and back: `#`, address, command, data64, two CRC characters, `\\r`.

data64 is base64 with another alphabet (`=` + 6 bits, zero padded), so the standard library's C
code does the work. `#` and `\\r` occur nowhere inside a frame: a decoder resynchronises at the
next one, and damage costs only the frames that it hits. The CRC is only a 12-bit sum, so the user
of a value still checks whether it is possible.
"""

from __future__ import annotations

from binascii import Error as BinasciiError
from binascii import a2b_base64, b2a_base64
from zlib import adler32

import msgspec

START, END = b"#", b"\r"
FLIGHT_CONTROLLER = ord("b")
MAX_FRAME = 64
"""Longest frame in bytes; the longest one of the contract has 34."""

_BASE64 = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
_DATA64 = bytes(range(ord("="), ord("=") + 64))
_TO_DATA64 = bytes.maketrans(_BASE64, _DATA64)
# Bytes that are no data64 become `!`, which strict base64 refuses.
_FROM_DATA64 = bytes(
    _BASE64[_DATA64.index(byte)] if byte in _DATA64 else ord("!") for byte in range(256)
)
_CRC = tuple(bytes((_DATA64[crc >> 6], _DATA64[crc & 63])) for crc in (4095, *range(4095)))
"""Checksums by the lower 12 bits of Adler-32, which are 1 + the sum of up to 256 bytes: computing
that takes a tenth of the time of Python's `sum`."""
_PAD = (b"", b"\0\0", b"\0")
_HEAD = START + bytes((FLIGHT_CONTROLLER,))
_MIN_CHUNK = 5  # `#`, address, command and CRC of a frame without data


class Frame(msgspec.Struct, frozen=True):
    """One undamaged frame; `payload` is zero padded to a multiple of 3 bytes."""

    address: int
    command: int
    payload: bytes


def encode_frame(command: bytes, payload: bytes) -> bytes:
    """Encode the bytes of one frame."""
    padded = payload + _PAD[len(payload) % 3]
    body = _HEAD + command + b2a_base64(padded, newline=False).translate(_TO_DATA64)
    return body + _CRC[adler32(body) & 4095] + END


class FrameDecoder:
    """Decoder that cuts one port's bytes into frames; keeps at most one unfinished frame.

    `damaged` counts the pieces between two frames that were not a frame.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Decode the frames that end within `data`, in order. Never raises, whatever the bytes."""
        if not self._rest and data.find(END) + 1 == len(data) > 0:  # usually exactly one frame
            frame = self._decode(data[:-1])
            return [] if frame is None else [frame]
        chunks = (self._rest + data).split(END)
        rest = chunks.pop()
        if len(rest) > MAX_FRAME:  # no frame is this long: keep only a possible start
            self.damaged += 1
            rest = rest[rest.rfind(START) :][:MAX_FRAME] if START in rest else b""
        self._rest = rest
        frames = []
        for chunk in chunks:
            frame = self._decode(chunk)
            if frame is not None:
                frames.append(frame)
        return frames

    def _decode(self, chunk: bytes) -> Frame | None:
        start = chunk.rfind(START)
        if start > 0:  # noise, or a frame that lost its end, before this one
            self.damaged += 1
            chunk = chunk[start:]
        if (
            start >= 0
            and _MIN_CHUNK <= len(chunk) <= MAX_FRAME
            and chunk[-2:] == _CRC[adler32(chunk[:-2]) & 4095]
        ):
            try:
                data = a2b_base64(chunk[3:-2].translate(_FROM_DATA64), strict_mode=True)
                return Frame(chunk[1], chunk[2], data)
            except BinasciiError:  # not whole groups of four, or other characters
                pass
        self.damaged += 1
        return None
