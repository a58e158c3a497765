"""A small writer of the Crazyflie's µSD logs, version 2."""

from __future__ import annotations

import struct
from pathlib import Path
from zlib import crc32

import numpy as np
import numpy.typing as npt

EVENT = 65535


def write_crazyflie(path: Path, name: str, us: npt.NDArray[np.int64], **columns: object) -> Path:
    """Write one kind of event with floats; a name's last _ stands for a dot."""
    names = [one.replace("_", ".") for one in columns]
    head = [b"\xbc", struct.pack("<HHH", 2, 1, EVENT), name.encode(), b"\0"]
    head += [struct.pack("<H", len(names)), *(f"{one}(f)".encode() + b"\0" for one in names)]
    rows = np.zeros(len(us), [("id", "<u2"), ("t", "<u8"), ("v", "<f4", len(names))])
    rows["id"], rows["t"] = EVENT, us
    rows["v"] = np.stack([np.asarray(one) for one in columns.values()], axis=1)
    data = b"".join([*head, rows.tobytes()])
    path.write_bytes(data + struct.pack("<I", crc32(data)))
    return path
