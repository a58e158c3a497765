"""The seven typed messages: their sizes on the line, round trips and refusals."""

from __future__ import annotations

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from quadrotor.errors import OutOfBoundsError
from vehicle_link.serial import commands as c
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, Id

REFERENCES = (0, 127, 200, 255)
int16 = st.integers(-32768, 32767)


def one(data: bytes) -> Frame:
    (frame,) = FrameDecoder().feed(data)
    return frame


def test_sizes_on_the_line() -> None:
    sizes = {
        "b": len(c.encode_command(REFERENCES)),
        "s": len(c.encode_set(REFERENCES, 32, 1)),
        "u": len(c.encode_request(REFERENCES, 40)),
        "l": len(c.encode_mirror(REFERENCES, MIRROR)),
        "S": len(c.encode_value(32, 1)),
        "D": len(c.encode_data(bytes(20))),
        "L": len(c.encode_mirrored(MIRROR)),
    }
    assert sizes == {"b": 14, "s": 18, "u": 14, "l": 26, "S": 14, "D": 34, "L": 22}


def test_a_port_carries_338_data_frames_a_second() -> None:
    assert 11_520 // len(c.encode_data(bytes(20))) == 338  # 338.8: the contract rounds up


def test_every_frame_to_the_microcontroller_starts_with_the_command() -> None:
    for data in (
        c.encode_command(REFERENCES),
        c.encode_set(REFERENCES, 32, 1),
        c.encode_request(REFERENCES, 40),
        c.encode_mirror(REFERENCES, MIRROR),
    ):
        assert one(data).payload[:4] == bytes(REFERENCES)
        instruction = c.decode_instruction(one(data))
        assert instruction is not None
        assert instruction.references == REFERENCES


@given(int16, int16)
@settings(max_examples=50, deadline=None)
def test_sets_and_values_round_trip(id: int, value: int) -> None:
    instruction = c.decode_instruction(one(c.encode_set(REFERENCES, id, value)))
    assert instruction == c.Instruction(c.SET, REFERENCES, id, value)
    assert c.decode_value(one(c.encode_value(id, value))) == (id, value)


def test_mirrors_and_requests_round_trip() -> None:
    mirror = c.decode_instruction(one(c.encode_mirror(REFERENCES, MIRROR)))
    assert mirror == c.Instruction(c.MIRROR, REFERENCES, ids=tuple(MIRROR))
    assert c.decode_mirrored(one(c.encode_mirrored(MIRROR))) == MIRROR
    request = c.decode_instruction(one(c.encode_request(REFERENCES, Id.ROBOT_ID)))
    assert request == c.Instruction(c.REQUEST, REFERENCES, Id.ROBOT_ID)


def test_data_are_ten_little_endian_int16() -> None:
    values = one(c.encode_data(b"\x01\x00\xff\xff" + bytes(14) + b"\x00\x80"))
    assert c.decode_data(values) == (1, -1, 0, 0, 0, 0, 0, 0, 0, -32768)


@pytest.mark.parametrize("references", [(0, 0, 0), (0, 0, 0, 256), (0, 0, 0, -1), (1.5, 0, 0, 0)])
def test_impossible_references_are_refused(references: tuple[int, ...]) -> None:
    with pytest.raises(OutOfBoundsError, match="four integers from 0 to 255"):
        c.encode_command(references)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(OutOfBoundsError, match=re.escape("(32, 40000) does not fit 16 bits")):
        c.encode_set(REFERENCES, 32, 40_000)
    with pytest.raises(OutOfBoundsError, match="ten ids from 0 to 127"):
        c.encode_mirror(REFERENCES, (1, 2))


def test_messages_of_the_wrong_kind_or_size_are_not_understood() -> None:
    data = one(c.encode_data(bytes(20)))
    assert c.decode_instruction(data) is None
    assert c.decode_value(data) is None
    assert c.decode_mirrored(data) is None
    assert c.decode_data(replace(data, payload=bytes(18))) is None
    command = one(c.encode_command(REFERENCES))
    assert c.decode_instruction(replace(command, address=ord("c"))) is None
    assert c.decode_instruction(replace(command, payload=bytes(9))) is None
