"""Values that no sensor of a vehicle measures, and no vehicle reaches."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from extensions.importers.mapping import Rows
from extensions.importers.rows import blocks
from extensions.importers.units import FORCE_UNITS, LENGTH_UNITS, RATE_UNITS
from quadrotor.errors import LogFormatError
from quadrotor.records import Array

MOST = {
    "specific_force": (2000.0, FORCE_UNITS),  # m/s^2, 200 g
    "angular_velocity": (200.0, RATE_UNITS),  # rad/s, 11,500 deg/s
    "position": (1e8, LENGTH_UNITS),  # m; as coordinates of a map
    "velocity": (1e4, LENGTH_UNITS),  # m/s
    "quaternion": (1e3, {"": 1.0}),  # of any scale but none
    "euler": (1e3, {"deg": 1.0}),  # turns may be counted
    "voltage": (1e3, {"V": 1.0}),
}
"""Largest values, in SI units, and the units in which they may be written."""
SHARE = 0.01
"""Largest share of such rows that is left out; more of them are another column, or another unit."""


def measurable(
    columns: Mapping[str, Array], rows: Rows, where: str
) -> tuple[npt.NDArray[np.bool_], list[str]]:
    """Return which rows can have been measured, (N,), and notes about the others.

    Args:
        columns: (N, K) each, by the word of the mapping; NaN where a number is missing.

    Raises LogFormatError when more rows than a few have such values.
    """
    kept = np.ones(len(next(iter(columns.values()))), bool)
    notes = []
    for word, values in columns.items():
        if word not in MOST:
            continue
        most, units = MOST[word]
        stated = getattr(rows, f"{'position' if word == 'velocity' else word}_unit", None)
        unit = stated if isinstance(stated, float) else units.get(str(stated), min(units.values()))
        beyond = np.zeros(len(values), bool)
        for some in blocks(values):
            beyond[some] = (np.abs(values[some]) > most / unit).any(axis=1)
        if not (count := int(beyond.sum())):
            continue
        k = int(np.argmax(beyond))
        largest = values[k][np.argmax(np.abs(values[k]))]
        finding = (
            f"{where} {word}: {count} of {len(values)} rows have values that cannot have been "
            f"measured, the first in row {k + 1}: {largest:.4g}"
        )
        if count > SHARE * len(values):
            raise LogFormatError(f"{finding}; are these the right columns, and the right unit?")
        notes.append(f"{finding}; left out")
        kept &= ~beyond
    return kept, notes
