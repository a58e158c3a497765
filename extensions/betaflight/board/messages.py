"""The MSP messages of Betaflight that are used, decoded from their payloads."""

from __future__ import annotations

import struct
from enum import IntEnum

import msgspec

from quadrotor.errors import LinkError


class Function(IntEnum):
    """Numbers of MSP functions."""

    API_VERSION = 1
    VARIANT = 2
    VERSION = 3
    RAW_IMU = 102
    ANALOG = 110
    BOX_IDS = 119
    STATUS = 150  # MSP_STATUS_EX
    SET_RC = 200


ARM_BOX, ANGLE_BOX, FAILSAFE_BOX = 0, 1, 27
"""Permanent ids of modes."""
FIRMWARE = "BTFL"
OLDEST, NEWEST = (4, 5), (4, 6)
"""Firmware versions that were tried; the messages of others may differ."""

_IMU = struct.Struct("<6h")
_STATUS = struct.Struct("<HHHIBHBB")
_ANALOG = struct.Struct("<BHHhH")
_FLAGS = struct.Struct("<BI")


class Status(msgspec.Struct, frozen=True):
    """The status that the board reports in MSP_STATUS_EX."""

    cycle_us: int  # of its control loop
    sensors: int  # bit 1: a barometer
    boxes: int  # bit k: the k-th mode of BOX_IDS is on
    load: int  # % of its processor
    arming_blocks: int  # bits of extensions.betaflight.board.arming
    block_count: int  # of these bits, which differs between versions

    @property
    def has_barometer(self) -> bool:
        return bool(self.sensors >> 1 & 1)

    def modes(self, ids: bytes) -> set[int]:
        """Return the permanent ids of the modes that are on; `ids` is the payload of BOX_IDS."""
        return {box for k, box in enumerate(ids[:32]) if self.boxes >> k & 1}


def decode_imu(payload: bytes) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Return (accelerometer, in counts; gyroscope, in counts), body axes. Raises LinkError."""
    x, y, z, p, q, r = _unpack(_IMU, payload, Function.RAW_IMU)
    return (x, y, z), (p, q, r)


def decode_status(payload: bytes) -> Status:
    """Return the status. Raises LinkError."""
    cycle_us, _, sensors, boxes, _, load, _, _ = _unpack(_STATUS, payload, Function.STATUS)
    more = _STATUS.size + 1 + (payload[_STATUS.size] & 15 if len(payload) > _STATUS.size else 0)
    count, blocks = _unpack(_FLAGS, payload[more:], Function.STATUS)
    return Status(cycle_us, sensors, boxes, load, blocks, count)


def decode_voltage(payload: bytes) -> float:
    """Return the battery's voltage in V. Raises LinkError."""
    return 0.01 * float(_unpack(_ANALOG, payload, Function.ANALOG)[4])


def check_firmware(variant: bytes, version: bytes, *, newer: bool = False) -> str:
    """Return what is wrong with the firmware, "" for one whose messages are known.

    Args:
        variant, version: payloads of VARIANT and VERSION.
        newer: whether a version newer than NEWEST is flown.
    """
    name = variant.decode("ascii", "replace")
    if name != FIRMWARE:
        return f"the board's firmware calls itself {name!r}, not Betaflight ({FIRMWARE})"
    if len(version) < 3:
        return "the board did not report its Betaflight version"
    found, named = (version[0], version[1]), ".".join(str(part) for part in version[:3])
    if found < OLDEST:
        return f"Betaflight {named} is older than 4.5: flash 4.5 or newer"
    if found > NEWEST and not newer:
        return (
            f"Betaflight {named} is newer than 4.6, the newest that was tried: flash 4.6, or set "
            "board.newer and try it without propellers first"
        )
    return ""


def _unpack(form: struct.Struct, payload: bytes, function: Function) -> tuple[int, ...]:
    if len(payload) < form.size:
        raise LinkError(
            f"MSP {function.name} has {len(payload)} bytes, at least {form.size} are expected; "
            "is the firmware Betaflight 4.5 or newer?"
        )
    return form.unpack_from(payload)
