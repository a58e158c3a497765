"""CRC-8/DVB-S2, the checksum of MSP v2 and of CRSF."""

from __future__ import annotations

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
