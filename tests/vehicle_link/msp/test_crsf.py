"""CRSF: the channels of a frame, read back bit by bit."""

from __future__ import annotations

import math

import pytest

from quadrotor.errors import OutOfBoundsError
from vehicle_link.msp.crsf import encode_channels
from vehicle_link.msp.frames import crc8


def counts_of(frame: bytes) -> list[int]:
    """Read the channels as the protocol's text describes them, one bit at a time."""
    bits = [byte >> k & 1 for byte in frame[3:25] for k in range(8)]
    return [sum(bits[11 * c + k] << k for k in range(11)) for c in range(16)]


def test_a_frame_has_address_length_type_and_checksum() -> None:
    frame = encode_channels([1500.0] * 16)
    assert (len(frame), frame[0], frame[1], frame[2]) == (26, 0xC8, 24, 0x16)
    assert crc8(frame[2:]) == 0  # of a body with its own checksum
    assert counts_of(frame) == [992] * 16


def test_channels_keep_their_places_and_the_rest_is_in_the_middle() -> None:
    frame = encode_channels([1000.0, 2000.0, 1500.0, 988.0, 2012.0])
    assert counts_of(frame) == [192, 1792, 992, 173, 1811, *[992] * 11]


@pytest.mark.parametrize("pulse", [879.0, 2160.0, math.nan, math.inf])
def test_pulses_beyond_eleven_bits_are_refused(pulse: float) -> None:
    with pytest.raises(OutOfBoundsError, match=r"channel 2 of .* µs cannot be sent"):
        encode_channels([1500.0, pulse])


def test_seventeen_channels_are_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="17 channels cannot be sent"):
        encode_channels([1500.0] * 17)
