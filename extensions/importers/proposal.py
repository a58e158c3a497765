"""A mapping proposed for tables whose names say nothing to quadlab, for a person to confirm.

Columns are told by what their numbers do (gravity, length 1, rising stamps, rates of instruments),
by the units in the header, and by words in their names; the proposal states each reason.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from extensions.importers.checks import LARGEST_RATE
from extensions.importers.proposed_tables import Table, find, force_unit, read_table, values_of
from extensions.importers.readers.formats import format_of, source_of
from extensions.importers.readers.progress import bounded_time
from extensions.importers.units import RATE_UNITS, unit_of
from quadrotor.errors import LogFormatError, UsageError, os_errors

NAMED_RATES = {"deg/s": ("dps", "deg"), "rad/s": ("rad",)}
"""Words in names by the unit that they tell."""
FULL_TURN = 6.3  # rad; larger angles are in degrees


def propose(path: Path, target: Path) -> list[str]:
    """Write a proposed mapping into a new file, and return the findings, a line each.

    Raises LogFormatError with what the file has if no IMU is found, StorageError, or UsageError if
    the file is there already.
    """
    if target.exists():
        raise UsageError(f"{target} is there already: name a new file")
    format_of(path)
    with source_of(path, ()) as source:
        names = source.tables()
    with bounded_time([path]), source_of(path, names) as source:
        tables = [one for name in names if (one := read_table(source, name)) is not None]
    for one in tables:
        find(one)
    found = next((one for one in tables if {*SECTIONS["imu"]} <= one.groups.keys()), None)
    if found is None:
        raise LogFormatError(
            f"{path.name} has no columns that look like gyroscope and accelerometer at 20 Hz or "
            "more, without which a flight is not imported; it has "
            + ("; ".join(map(_told, tables)) or "no table with numbers")
        )
    is_turned = any({"quaternion", "euler"} & one.groups.keys() for one in tables)
    lines, text = [], ['vehicle = "imported"']
    for section, words in SECTIONS.items():
        if table := found if section == "imu" else _best(tables, found, words[0]):
            chosen = {word: table.groups[word] for word in words if word in table.groups}
            text += ["", f"[{section}]", *_written(table, chosen, turning_is_known=is_turned)]
            lines += [_reason(section, table, word, names) for word, names in chosen.items()]
    with os_errors(lambda why: f"cannot write {target}: {why}"):
        target.write_text("\n".join(text) + "\n", encoding="utf-8")
    return lines


SECTIONS = {
    "imu": ("angular_velocity", "specific_force"),
    "truth": ("position", "velocity", "quaternion", "euler"),
    "battery": ("voltage",),
}


def _best(tables: Sequence[Table], imu: Table, word: str) -> Table | None:
    """Return the table with such columns, that of the IMU first."""
    return next((one for one in (imu, *tables) if word in one.groups), None)


def _written(
    table: Table, chosen: dict[str, list[str]], *, turning_is_known: bool
) -> Iterator[str]:
    """Yield the lines of a section, with a remark where a person has to look.

    Args:
        turning_is_known: whether attitudes tell the unit of the gyroscope at the import.
    """
    if table.name:
        yield f"table = {_quoted(table.name)}"
    yield f"time = {_quoted(table.time)}"
    yield f'time_unit = "{table.time_unit}"'
    for word, names in chosen.items():
        listed = ", ".join(map(_quoted, names))
        yield f"{word} = {_quoted(names[0]) if word == 'voltage' else f'[{listed}]'}"
        if word == "specific_force":
            yield f'specific_force_unit = "{force_unit(table, names)}"  # its length is gravity'
        elif word == "angular_velocity":
            yield _written_rate(table, names, turning_is_known)
        elif word == "euler":
            yield 'euler_order = "ZYX"  # guessed: about the body\'s axes; check this'
            yield _written_angle(table, names)
        elif word == "quaternion" and "w" in names[0].lower():
            yield 'quaternion_order = "wxyz"'


def _written_rate(table: Table, names: list[str], turning_is_known: bool) -> str:
    told = unit_of(table.units.get(names[0], ""))
    if told in RATE_UNITS:
        return f'angular_velocity_unit = "{told}"  # as the header says'
    for unit, words in NAMED_RATES.items():
        if any(word in names[0].lower() for word in words):
            return f'angular_velocity_unit = "{unit}"  # as the name says'
    if turning_is_known:
        return "# angular_velocity_unit is found by the attitudes"
    largest = float(np.percentile(np.abs(values_of(table, names)), 99.9))
    unit = "deg/s" if largest > LARGEST_RATE else "rad/s"
    return f'angular_velocity_unit = "{unit}"  # guessed: it reaches {largest:.3g}; check this'


def _written_angle(table: Table, names: list[str]) -> str:
    told = table.units.get(names[0], "").lower()
    largest = float(np.abs(values_of(table, names)).max(initial=0.0))
    unit = "deg" if largest > FULL_TURN or told.startswith(("deg", "°")) else "rad"
    return f'euler_unit = "{unit}"  # they reach {largest:.3g}; check this'


def _quoted(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def _reason(section: str, table: Table, word: str, names: list[str]) -> str:
    where = f" of {table.name}" if table.name else ""
    length = np.median(np.linalg.norm(values_of(table, names), axis=1))
    rate = f"{table.rate:.4g} Hz by {table.time} in {table.time_unit}"
    return f"[{section}] {word}: {', '.join(names)}{where}, {rate}, median length {length:.4g}"


def _told(table: Table) -> str:
    """Return what a table has, for a person who has to name its columns."""
    names, rows = list(table.columns), len(next(iter(table.columns.values())))
    shown = ", ".join(names[:12]) + f" and {len(names) - 12} more" * (len(names) > 12)
    rate = f" at {table.rate:.3g} Hz" if table.time else " without a time"
    return f"{table.name or 'a table'} ({rows} rows{rate}: {shown})"
