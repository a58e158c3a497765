"""CRSF's frame of 16 channels, as a receiver sends it to a flight controller at 420 kBd.

Address, length, type, 16 channels of 11 bits (the least significant first), CRC-8 over type and
channels. A channel's 1500 µs are 992; a µs is 1.6 counts.
"""

from __future__ import annotations

from collections.abc import Sequence

from extensions.betaflight.msp.frames import crc8
from quadrotor.errors import OutOfBoundsError

BAUD_RATE = 420_000
CHANNELS = 16
ADDRESS, RC_CHANNELS = 0xC8, 0x16
MIDDLE_US, MIDDLE, COUNTS_PER_US = 1500.0, 992, 1.6
_BITS, _LENGTH = 11, 22


def encode_channels(pulses_us: Sequence[float]) -> bytes:
    """Return the frame of up to 16 channels (µs, 880 to 2159); those not given are in the middle.

    Raises OutOfBoundsError.
    """
    if len(pulses_us) > CHANNELS:
        raise OutOfBoundsError(f"{len(pulses_us)} channels cannot be sent; CRSF has {CHANNELS}")
    packed = 0
    for index in range(CHANNELS):
        pulse = pulses_us[index] if index < len(pulses_us) else MIDDLE_US
        if not 880.0 <= pulse <= 2159.0:  # also catches NaN
            raise OutOfBoundsError(
                f"channel {index + 1} of {pulse} µs cannot be sent; allowed are 880 to 2159"
            )
        packed |= round(MIDDLE + (pulse - MIDDLE_US) * COUNTS_PER_US) << _BITS * index
    body = bytes((RC_CHANNELS,)) + packed.to_bytes(_LENGTH, "little")
    return bytes((ADDRESS, len(body) + 1)) + body + bytes((crc8(body),))
