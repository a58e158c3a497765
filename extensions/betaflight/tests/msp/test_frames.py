"""MSP v2: frames are read back as sent, and damage costs only the damaged frame."""

from __future__ import annotations

import random

import pytest

from extensions.betaflight.msp.frames import (
    ERROR,
    REPLY,
    REQUEST,
    Message,
    MessageDecoder,
    crc8,
    encode,
)
from quadrotor.errors import OutOfBoundsError


def test_the_checksum_is_that_of_the_catalogue() -> None:
    assert crc8(b"123456789") == 0xBC  # check value of CRC-8/DVB-S2


def test_a_request_has_the_bytes_of_the_specification() -> None:
    """The protocol's own example: MSP2 of MSP_IDENT (100), without payload."""
    assert encode(100) == bytes((0x24, 0x58, 0x3C, 0x00, 0x64, 0x00, 0x00, 0x00, 0x8F))


@pytest.mark.parametrize("direction", [REQUEST, REPLY, ERROR])
def test_frames_are_read_back_however_the_bytes_are_cut(direction: bytes) -> None:
    generator = random.Random(f"frames {direction!r}")
    sent = [
        Message(generator.randrange(65536), generator.randbytes(generator.randrange(60)), direction)
        for _ in range(50)
    ]
    stream = b"".join(encode(m.function, m.payload, m.direction) for m in sent)
    decoder = MessageDecoder()
    received: list[Message] = []
    while stream:
        cut = generator.randrange(1, 12)
        received += decoder.feed(stream[:cut])
        stream = stream[cut:]
    assert received == sent
    assert decoder.damaged == 0


def test_damage_costs_one_frame() -> None:
    frames = [encode(102, bytes((k,) * 18), REPLY) for k in range(1, 11)]
    damaged = bytearray(frames[4])
    damaged[12] ^= 0x40
    frames[4] = bytes(damaged)
    decoder = MessageDecoder()
    received = list(decoder.feed(b"noise" + b"".join(frames)))
    assert [m.payload[0] for m in received] == [1, 2, 3, 4, 6, 7, 8, 9, 10]
    assert decoder.damaged == 2


def test_any_bytes_are_survived() -> None:
    generator = random.Random("any bytes are survived")
    decoder = MessageDecoder()
    for _ in range(2000):
        list(decoder.feed(generator.randbytes(generator.randrange(1, 20)) + b"$X>"))
    tail = encode(150, b"end", REPLY)
    found = list(decoder.feed(b"\0" * 600 + tail))  # ends a frame that damage may have begun
    assert found[-1] == Message(150, b"end", REPLY)
    assert decoder.damaged > 0


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="MSP function 65536 with 0 bytes cannot be sent"):
        encode(65536)
    with pytest.raises(OutOfBoundsError, match="with 513 bytes"):
        encode(1, bytes(513))
