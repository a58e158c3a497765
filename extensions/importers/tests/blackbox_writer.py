"""A small writer of Betaflight's blackbox: header and frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from extensions.importers.readers.blackbox import MAGIC

END = b"E\xffEnd of log\0"
FLIGHT = [
    "loopIteration",
    "time",
    *(f"{n}[{k}]" for n in ("gyroADC", "accSmooth") for k in range(3)),
]


def unsigned(value: int) -> bytes:
    """Return a number as 7 bits a byte, lowest first, each but the last with the highest bit."""
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def signed(value: int) -> bytes:
    """Return a number whose lowest bit is its sign: 0, -1, 1, -2, …"""
    return unsigned(2 * value if value >= 0 else -2 * value - 1)


def header(
    names: Sequence[str],
    intra: Sequence[tuple[int, int]],
    inter: Sequence[tuple[int, int]] = (),
    **lines: Any,
) -> bytes:
    """Return a header; predictor and encoding of each field of I and of P frames.

    Args:
        lines: further lines, as acc_1G=2048; None leaves out one that would be there.
    """
    inter = inter or [(6, 9), (2, 0), *[(1, 0)] * (len(names) - 2)]
    is_signed = [0, 0, *[int(not one.startswith(("motor", "u"))) for one in names[2:]]]
    found: dict[str, object] = {
        "Data version": 2,
        "I interval": 32,
        "Field I name": names,
        "Field I signed": is_signed,
        "Field I predictor": [one for one, _ in intra],
        "Field I encoding": [one for _, one in intra],
        "Field P predictor": [one for one, _ in inter],
        "Field P encoding": [one for _, one in inter],
        "Firmware type": "Cleanflight",
        "P interval": "1/1",
        "gyro_scale": "0x3f800000",
        "acc_1G": 2048,
    }
    found |= lines
    out = MAGIC + b"\n"
    for key, value in found.items():
        text = ",".join(map(str, value)) if isinstance(value, list | tuple) else str(value)
        out += f"H {key}:{text}\n".encode() if value is not None else b""
    return out


def flight_log(rows: Sequence[Sequence[int]], others: int = 0, **lines: Any) -> bytes:
    """Return a log of rows of FLIGHT, whose first column counts from 0: an I frame and 31 P.

    Args:
        others: number of further fields, 0 throughout, a byte each.
    """
    names = [*FLIGHT, *(f"axisP[{k}]" for k in range(others))]
    out = header(names, [(0, 1), (0, 1), *[(0, 0)] * (len(names) - 2)], **lines)
    for k, row in enumerate(rows):
        if k % 32 == 0:
            out += b"I" + unsigned(row[0]) + unsigned(row[1]) + b"".join(map(signed, row[2:]))
        else:
            last = rows[k - 1]
            before = rows[k - 2] if k % 32 > 1 else last
            out += b"P" + signed(row[1] - 2 * last[1] + before[1])
            out += b"".join(signed(x - y) for x, y in zip(row[2:], last[2:], strict=True))
        out += bytes(others)
    return out + END
