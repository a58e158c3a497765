"""A small writer of ULog: header, definitions, subscriptions and data."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

MAGIC = b"ULog\x01\x12\x35\x01"
KINDS = {"u8": "uint64_t", "f4": "float", "u4": "uint32_t", "u1": "uint8_t"}


def write_ulog(
    path: Path,
    topics: dict[str, npt.NDArray[Any]],
    start_us: int = 0,
    texts: tuple[str, ...] = (),
    dropouts_ms: tuple[int, ...] = (),
) -> Path:
    """Write topics as structured arrays, each with a field `timestamp` (us), in their order; what
    follows a blank in a name is left out.
    """
    parts = [MAGIC + struct.pack("<Q", start_us), _message(b"B", bytes(40))]
    bodies, stamps = [], []
    for name, rows in topics.items():
        assert rows.dtype.names
        assert rows.dtype.fields
        fields = []
        for field in rows.dtype.names:
            kind = rows.dtype.fields[field][0]
            base, shape = kind.subdtype or (kind, ())
            size = f"[{shape[0]}]" if shape else ""
            fields.append(f"{KINDS[base.str[1:]]}{size} {field};")
        parts.append(_message(b"F", f"{name.split()[0]}:{''.join(fields)}".encode()))
    for number, (name, rows) in enumerate(topics.items()):
        parts.append(_message(b"A", struct.pack("<BH", 0, number) + name.split()[0].encode()))
        width = rows.dtype.itemsize
        whole = np.zeros(len(rows), [("head", "V5"), ("row", f"V{width}")])
        head = struct.pack("<HcH", width + 2, b"D", number)
        whole["head"] = np.frombuffer(head, "V5")[0]
        whole["row"] = rows.view(f"V{width}")
        bodies.append(whole.tobytes())
        stamps.append(rows["timestamp"])
    for k, text in enumerate(texts):
        parts.append(_message(b"L", struct.pack("<BQ", ord("4"), start_us + k) + text.encode()))
    order = np.argsort(np.concatenate(stamps), kind="stable")
    sizes = np.concatenate(
        [np.full(len(s), len(b) // max(1, len(s))) for s, b in zip(stamps, bodies, strict=True)]
    )
    every = b"".join(bodies)
    starts = np.cumsum(sizes) - sizes
    parts += [every[a : a + n] for a, n in zip(starts[order], sizes[order], strict=True)]
    parts += [_message(b"O", struct.pack("<H", ms)) for ms in dropouts_ms]
    path.write_bytes(b"".join(parts))
    return path


def _message(kind: bytes, data: bytes) -> bytes:
    return struct.pack("<Hc", len(data), kind) + data
