"""A small writer of the Crazyflie's µSD logs, version 2."""

from __future__ import annotations

import struct
from pathlib import Path
from zlib import crc32

import numpy as np
import numpy.typing as npt

EVENT = 65535


Event = tuple[npt.NDArray[np.int64], dict[str, object]]
"""Times, µs, and columns of numbers."""


def write_crazyflie(path: Path, name: str, us: npt.NDArray[np.int64], **columns: object) -> Path:
    """Write one kind of event with floats; a name's last _ is replaced by a dot."""
    return write_events(path, {name: (us, columns)})


def write_events(path: Path, events: dict[str, Event]) -> Path:
    """Write several kinds of events with floats, one kind after the other."""
    head, written = [b"\xbc", struct.pack("<HH", 2, len(events))], []
    for number, (name, (us, columns)) in enumerate(events.items(), start=EVENT - len(events)):
        names = [one.replace("_", ".") for one in columns]
        head += [struct.pack("<H", number), name.encode(), b"\0"]
        head += [struct.pack("<H", len(names)), *(f"{one}(f)".encode() + b"\0" for one in names)]
        rows = np.zeros(len(us), [("id", "<u2"), ("t", "<u8"), ("v", "<f4", len(names))])
        rows["id"], rows["t"] = number, us
        rows["v"] = np.stack([np.asarray(one) for one in columns.values()], axis=1)
        written.append(rows.tobytes())
    data = b"".join([*head, *written])
    path.write_bytes(data + struct.pack("<I", crc32(data)))
    return path
