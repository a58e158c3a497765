"""The serial contract's seven messages, typed: b, s, u, l to the microcontroller; S, D, L back.

Every frame to the microcontroller starts with the four bytes of the current command, the motor
references in direct mode, so that a set never leaves it without one.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import msgspec

from quadrotor.errors import OutOfBoundsError
from vehicle_link.serial.frames import FLIGHT_CONTROLLER, Frame, encode_frame

COMMAND, SET, REQUEST, MIRROR = ord("b"), ord("s"), ord("u"), ord("l")
VALUE, DATA, MIRRORED = ord("S"), ord("D"), ord("L")

MIRROR_SIZE = 10
"""Number of values in one `D` frame."""

_TWO = struct.Struct("<hh")
_ONE = struct.Struct("<h")
_TEN = struct.Struct("<10h")
_PADDED = {COMMAND: 6, SET: 9, REQUEST: 6, MIRROR: 15, VALUE: 6, DATA: 21, MIRRORED: 12}


class Instruction(msgspec.Struct, frozen=True):
    """A frame's instruction; `ids` only in `l`, `id` in `s` and `u`, `value` in `s`."""

    kind: int
    references: tuple[int, int, int, int]
    id: int = 0
    value: int = 0
    ids: tuple[int, ...] = ()


# ---------------------------------------------------------------- to the microcontroller
def encode_command(references: Sequence[int]) -> bytes:
    """Encode `b`: four motor references, 0…255. Raises OutOfBoundsError."""
    return encode_frame(b"b", _references(references))


def encode_set(references: Sequence[int], id: int, value: int) -> bytes:
    """Encode `s`: set one value; answered by `S`. Raises OutOfBoundsError."""
    return encode_frame(b"s", _references(references) + _int16s(_TWO, id, value))


def encode_request(references: Sequence[int], id: int) -> bytes:
    """Encode `u`: ask for one value once; answered by `S`. Raises OutOfBoundsError."""
    return encode_frame(b"u", _references(references) + _int16s(_ONE, id))


def encode_mirror(references: Sequence[int], ids: Sequence[int]) -> bytes:
    """Encode `l`: which ten values to send in every `D`; answered by `L`. Raises
    OutOfBoundsError.
    """
    return encode_frame(b"l", _references(references) + _ids(ids))


def decode_instruction(frame: Frame) -> Instruction | None:
    """Decode a frame to the microcontroller; None when it is not one of b, s, u, l."""
    kind, payload = frame.command, frame.payload
    if frame.address != FLIGHT_CONTROLLER or len(payload) != _PADDED.get(kind):
        return None
    references = (payload[0], payload[1], payload[2], payload[3])
    if kind == COMMAND:
        return Instruction(kind, references)
    if kind == SET:
        id, value = _TWO.unpack_from(payload, 4)
        return Instruction(kind, references, id, value)
    if kind == REQUEST:
        return Instruction(kind, references, _ONE.unpack_from(payload, 4)[0])
    if kind == MIRROR:
        return Instruction(kind, references, ids=tuple(payload[4 : 4 + MIRROR_SIZE]))
    return None


# ---------------------------------------------------------------- from the microcontroller
def encode_value(id: int, value: int) -> bytes:
    """Encode `S`: the value of one id. Raises OutOfBoundsError."""
    return encode_frame(b"S", _int16s(_TWO, id, value))


def encode_data(values: bytes) -> bytes:
    """Encode `D`: the mirrored values, ten little-endian int16 as 20 bytes."""
    return encode_frame(b"D", values)


def encode_mirrored(ids: Sequence[int]) -> bytes:
    """Encode `L`: the ids being mirrored. Raises OutOfBoundsError."""
    return encode_frame(b"L", _ids(ids))


def decode_value(frame: Frame) -> tuple[int, int] | None:
    """Decode (id, value) of an `S` frame; None for any other."""
    if frame.command != VALUE or len(frame.payload) != _PADDED[VALUE]:
        return None
    id, value = _TWO.unpack_from(frame.payload)
    return id, value


def decode_data(frame: Frame) -> tuple[int, ...] | None:
    """Decode the ten int16 of a `D` frame; None for any other."""
    if frame.command != DATA or len(frame.payload) != _PADDED[DATA]:
        return None
    return _TEN.unpack_from(frame.payload)


def decode_mirrored(frame: Frame) -> tuple[int, ...] | None:
    """Decode the ids of an `L` frame; None for any other."""
    if frame.command != MIRRORED or len(frame.payload) != _PADDED[MIRRORED]:
        return None
    return tuple(frame.payload[:MIRROR_SIZE])


def _references(references: Sequence[int]) -> bytes:
    try:
        packed = bytes(references)
    except (ValueError, TypeError):
        packed = b""
    if len(packed) != 4:
        raise OutOfBoundsError(
            f"motor references {tuple(references)!r} cannot be sent; "
            "allowed are four integers from 0 to 255"
        )
    return packed


def _int16s(layout: struct.Struct, *values: int) -> bytes:
    try:
        return layout.pack(*values)
    except struct.error:
        raise OutOfBoundsError(
            f"id or value of {values!r} does not fit 16 bits; allowed -32768 to 32767"
        ) from None


def _ids(ids: Sequence[int]) -> bytes:
    if len(ids) != MIRROR_SIZE or not all(0 <= id < 128 for id in ids):
        raise OutOfBoundsError(
            f"mirror ids {tuple(ids)!r} cannot be sent; allowed are ten ids from 0 to 127"
        )
    return bytes(ids)
