"""CRTP packets and their frames in a stream of bytes."""

from __future__ import annotations

import random

import pytest

from extensions.crazyflie.crtp.packets import NULL, FrameReader, Packet, decode, frame
from quadrotor.errors import OutOfBoundsError


def test_a_header_has_port_and_channel_and_ignores_the_reserved_bits() -> None:
    assert Packet(5, 2, b"ab").encode() == b"\x52ab"
    assert decode(b"\x5eab") == Packet(5, 2, b"ab")
    assert decode(NULL).is_null
    assert not Packet(15, 1).is_null


def test_a_packet_that_is_too_long_is_refused() -> None:
    assert len(Packet(5, 0, bytes(30)).encode()) == 31
    with pytest.raises(OutOfBoundsError, match="5:0 has 31 bytes; at most 30"):
        Packet(5, 0, bytes(31)).encode()


def test_frames_survive_any_cut_and_damage_costs_its_frame_alone() -> None:
    chance = random.Random(7)
    packets = [
        Packet(chance.randrange(16), chance.randrange(4), chance.randbytes(chance.randrange(31)))
        for _ in range(200)
    ]
    frames = [frame(packet.encode()) for packet in packets]
    reader = FrameReader()
    found: list[bytes] = []
    stream = b"".join(frames)
    while stream:
        cut = chance.randrange(1, 40)
        found += reader.feed(stream[:cut])
        stream = stream[cut:]
    assert [decode(data) for data in found] == packets
    assert reader.damaged == 0

    reader = FrameReader()
    broken = frames[1][:-1] + bytes((frames[1][-1] ^ 1,))
    got = [decode(data) for data in reader.feed(b"xy" + frames[0] + broken + frames[2])]
    assert got[0] == packets[0]
    assert got[-1] == packets[2]
    assert packets[1] not in got
    assert reader.damaged == 2
