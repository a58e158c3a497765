"""Columns of messages that are not in a file, by the names that they have in a log."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from flight_log.payload_layout import PayloadLayout, SchemaLayouts
from quadrotor.errors import LogFormatError
from vehicle_link.messages import definition, ros_name

Column = npt.NDArray[np.generic]
MOST_LAYOUTS = 100
"""Number of layouts kept of each size of a payload; beyond them the oldest is given up."""


def schema_of(type_name: str) -> Schema:
    """Return the description of one of our messages (`quadlab_msgs/VehicleStatus`)."""
    return Schema(0, definition(type_name).encode(), "ros2msg", ros_name(type_name))


class PayloadColumns:
    """Reader of the messages of one type. Raises LogFormatError as `SchemaLayouts`."""

    def __init__(self, schema: Schema) -> None:
        self._layouts = SchemaLayouts(schema, stamps=True)
        self._known: dict[int, list[PayloadLayout]] = {}  # by size

    def read(self, payloads: Sequence[bytes], wanted: Collection[str]) -> dict[str, Column]:
        """Return these columns of N messages, (N,) each: numbers as float64, NaN where a message
        has none, texts as objects, None where it has none.
        """
        found: dict[str, Column] = {}
        sizes = np.array([len(one) for one in payloads], np.int64)
        for size in set(sizes.tolist()):
            chosen = np.flatnonzero(sizes == size)
            data = b"".join([payloads[k] for k in chosen.tolist()])
            rows = np.frombuffer(data, np.uint8).reshape(len(chosen), size)
            while len(chosen):
                layout = self._layout_of(rows[0].tobytes())
                fits = np.zeros(len(rows), bool) if layout is None else layout.fits(rows)
                if layout is not None:
                    self._fill(found, layout, rows[fits], chosen[fits], len(payloads), wanted)
                fits[0] = True  # also of what cannot be read
                rows, chosen = rows[~fits], chosen[~fits]
        return found

    def _layout_of(self, payload: bytes) -> PayloadLayout | None:
        known = self._known.setdefault(len(payload), [])
        row = np.frombuffer(payload, np.uint8)[None]
        layout = next((one for one in known if one.fits(row)[0]), None)
        if layout is None:
            try:
                layout = self._layouts.of(payload)
            except LogFormatError:
                return None
            known.append(layout)
            del known[:-MOST_LAYOUTS]
        return layout

    @staticmethod
    def _fill(
        found: dict[str, Column],
        layout: PayloadLayout,
        rows: npt.NDArray[np.uint8],
        chosen: npt.NDArray[np.int64],
        count: int,
        wanted: Collection[str],
    ) -> None:
        read = np.ascontiguousarray(rows).view(layout.record)[:, 0] if layout.numbers else None
        for path in wanted:
            if read is not None and path in layout.numbers:
                found.setdefault(path, np.full(count, np.nan))[chosen] = read[path]
            elif path in layout.texts:
                texts = found.setdefault(path, np.full(count, None, object))
                [(offset, length)] = layout.texts[path]
                for k, row in zip(chosen.tolist(), rows, strict=True):
                    texts[k] = row[offset : offset + length].tobytes().decode(errors="replace")
