"""Frame layer: bytes as in the contract, and damage that spoils only what it hits."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehicle_link.serial.frames import MAX_FRAME, Frame, FrameDecoder, encode_frame

FRAMES = tuple(
    encode_frame(b"D", bytes(random.Random(seed).randrange(256) for _ in range(20)))
    for seed in range(5)
)


def slow_frame(command: str, payload: bytes) -> bytes:
    """Return a frame made as the contract's text says, bit by bit."""
    payload += bytes(-len(payload) % 3)
    bits = "".join(f"{byte:08b}" for byte in payload)
    data = "".join(chr(61 + int(bits[i : i + 6], 2)) for i in range(0, len(bits), 6))
    body = f"#b{command}{data}"
    crc = sum(body.encode()) % 4096
    return f"{body}{chr(61 + crc // 64)}{chr(61 + crc % 64)}\r".encode()


def is_subsequence(wanted: list[Frame], found: list[Frame]) -> bool:
    rest = iter(found)
    return all(frame in rest for frame in wanted)


def decode_all(*pieces: bytes) -> list[Frame]:
    decoder = FrameDecoder()
    return [frame for piece in pieces for frame in decoder.feed(piece)]


WHOLE = decode_all(*FRAMES)


@given(st.binary(max_size=40))
@settings(max_examples=200, deadline=None)
def test_a_frame_is_what_the_contract_writes(payload: bytes) -> None:
    assert encode_frame(b"D", payload) == slow_frame("D", payload)


@given(st.binary(max_size=40), st.sampled_from([b"b", b"s", b"S", b"D", b"L"]))
@settings(max_examples=200, deadline=None)
def test_what_is_encoded_is_decoded_zero_padded(payload: bytes, command: bytes) -> None:
    (frame,) = decode_all(encode_frame(command, payload))
    assert frame == Frame(ord("b"), command[0], payload + bytes(-len(payload) % 3))


@given(st.lists(st.integers(0, sum(map(len, FRAMES))), max_size=12))
@settings(max_examples=200, deadline=None)
def test_frames_may_arrive_in_any_pieces(cuts: list[int]) -> None:
    stream = b"".join(FRAMES)
    edges = [0, *sorted(cuts), len(stream)]
    pieces = [stream[a:b] for a, b in pairwise(edges)]
    assert decode_all(*pieces) == WHOLE


def test_any_wrong_byte_costs_only_its_own_frame() -> None:
    stream = b"".join(FRAMES)
    length = len(FRAMES[0])
    for position in range(2 * length, 3 * length):
        for value in range(256):
            if value != stream[position]:
                damaged = stream[:position] + bytes([value]) + stream[position + 1 :]
                found = decode_all(damaged)
                assert is_subsequence(WHOLE[:2] + WHOLE[3:], found), (position, value)
                assert WHOLE[2] not in found, (position, value)


@pytest.mark.parametrize("kept", range(34))
def test_a_truncated_frame_costs_only_itself(kept: int) -> None:
    stream = FRAMES[0] + FRAMES[1][:kept] + FRAMES[2]
    assert is_subsequence([WHOLE[0], WHOLE[2]], decode_all(stream))


@given(st.lists(st.binary(max_size=150), min_size=6, max_size=6), st.integers(1, 60))
@settings(max_examples=300, deadline=None)
def test_noise_between_frames_costs_no_frame(noise: list[bytes], step: int) -> None:
    stream = noise[0] + b"".join(f + n for f, n in zip(FRAMES, noise[1:], strict=True))
    pieces = [stream[i : i + step] for i in range(0, len(stream), step)]
    assert is_subsequence(WHOLE, decode_all(*pieces))


def test_frames_written_into_each_other_cost_at_most_both() -> None:
    one, other = FRAMES[1], FRAMES[2]
    for cut in range(1, len(one)):
        for size in range(1, len(other) + 1):
            mixed = one[:cut] + other[:size] + one[cut:] + other[size:]
            found = decode_all(FRAMES[0], mixed, FRAMES[3])
            assert is_subsequence([WHOLE[0], WHOLE[3]], found), (cut, size)


@given(st.lists(st.binary(max_size=300), max_size=20))
@settings(max_examples=300, deadline=None)
def test_no_bytes_raise_or_pile_up(pieces: list[bytes]) -> None:
    decoder = FrameDecoder()
    for piece in pieces:
        decoder.feed(piece)
        assert len(decoder._rest) <= MAX_FRAME
    decoder.feed(b"\r")
    assert decoder.feed(FRAMES[0]) == WHOLE[:1]


def test_damage_is_counted() -> None:
    decoder = FrameDecoder()
    decoder.feed(FRAMES[0] + b"noise\r" + FRAMES[1] + b"#bDxx\r")
    assert decoder.damaged == 2
