"""A mapping proposed for tables whose names say nothing to quadlab, for a person to confirm.

Columns are told by what their numbers do (gravity, length 1, rising stamps, rates of instruments),
by the units in the header, and by words in their names; the proposal states each reason.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from extensions.importers.checks import GRAVITY, LARGEST_RATE, LIKELY_FORCE
from extensions.importers.flights import FEWEST
from extensions.importers.readers.formats import format_of, source_of
from extensions.importers.readers.tables import Source
from extensions.importers.stamps import RATES, RATES_OF_IMU, fits
from extensions.importers.units import FORCE_UNITS, RATE_UNITS, TIME_UNITS, unit_of
from quadrotor.errors import LogFormatError, UsageError, os_errors
from quadrotor.records import Array

WORDS = {
    "time": ("time", "stamp", "ts", "t", "sec", "clock"),
    "specific_force": ("acc", "force", "a", "imu_a"),
    "angular_velocity": ("gyr", "omega", "angular", "rate", "w", "g", "pqr"),
    "position": ("pos", "translation", "loc", "p", "mocap", "vicon", "truth", "opti"),
    "velocity": ("vel", "speed", "v"),
    "quaternion": ("quat", "q", "orientation", "attitude", "rot"),
    "voltage": ("volt", "vbat", "batt"),
}
"""Beginnings of names by what they mean; those of one letter or two stand alone."""
NAMED_RATES = {"deg/s": ("dps", "deg"), "rad/s": ("rad",)}
"""Words in names by the unit that they tell."""
AXES, ITEMS = "xyz", "wxyz"
MOST_COLUMNS = 400  # of a table
STEADY = 0.5
"""Least length of the mean specific force relative to its median length."""
SMOOTH = 0.2
"""Largest step of a position relative to its deviation, both rms."""
BATTERY = (2.5, 70.0)  # V


@dataclass
class Table:
    """The numbers of a table and what they were found to be."""

    name: str
    columns: dict[str, Array]  # (N,)
    units: dict[str, str]
    time: str = ""
    time_unit: str = "s"
    rate: float = 0.0  # Hz
    groups: dict[str, list[str]] = field(default_factory=dict)  # columns by meaning


def propose(path: Path, target: Path) -> list[str]:
    """Write a proposed mapping into a new file, and return what was found, a line each.

    Raises LogFormatError with what the file has if no IMU is found, StorageError, or UsageError if
    the file is there already.
    """
    if target.exists():
        raise UsageError(f"{target} is there already: name a new file")
    format_of(path)
    with source_of(path, ()) as source:
        names = source.tables()
    with source_of(path, names) as source:
        tables = [one for name in names if (one := _table(source, name)) is not None]
    for one in tables:
        _find(one)
    found = next((one for one in tables if {*SECTIONS["imu"]} <= one.groups.keys()), None)
    if found is None:
        raise LogFormatError(
            f"{path.name} has no columns that look like gyroscope and accelerometer at 20 Hz or "
            "more, without which a flight is not imported; it has "
            + ("; ".join(map(_told, tables)) or "no table with numbers")
        )
    is_turned = any("quaternion" in one.groups for one in tables)
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
    "truth": ("position", "velocity", "quaternion"),
    "battery": ("voltage",),
}


def _table(source: Source, name: str) -> Table | None:
    """Return the columns of a table that has enough rows; those of one name twice are left out."""
    known = source.columns(name)
    names = [one for one in known if known.count(one) == 1][:MOST_COLUMNS]
    columns = {}
    for one in names:
        with (
            suppress(LogFormatError),
            np.errstate(invalid="ignore"),
        ):  # words, or numbers with separators of thousands
            columns[one] = source.read(name, [one])[:, 0]
    rows = len(next(iter(columns.values()), ()))
    return Table(name, columns, source.units) if rows >= FEWEST else None


def _find(table: Table) -> None:
    """Find what the columns of a table are."""
    _find_time(table)
    if not table.time:
        return
    triples = list(_grouped(table, AXES))
    judged = {
        "specific_force": _is_force,
        "angular_velocity": _is_turning,
        "velocity": _is_smooth,
        "position": _is_smooth,
    }
    for word, is_one in judged.items():
        if fitting := [names for names in triples if is_one(table, names)]:
            best = max(fitting, key=lambda names: _likeness(names, word))
            if word == "specific_force" or _likeness(best, word):
                table.groups[word] = best
                triples.remove(best)
    quaternions = [one for one in _grouped(table, ITEMS) if _is_unit_length(table, one)]
    if quaternions:
        table.groups["quaternion"] = max(quaternions, key=lambda one: _likeness(one, "quaternion"))
    for name, values in table.columns.items():
        middle = np.nanmedian(values) if np.isfinite(values).any() else np.nan
        if _likeness([name], "voltage") and BATTERY[0] < middle < BATTERY[1]:
            table.groups.setdefault("voltage", [name])
    if table.rate < RATES_OF_IMU.likely[0]:
        table.groups.pop("angular_velocity", None)


def _find_time(table: Table) -> None:
    """Find the column of time and its unit: rising, and at a rate that an instrument has."""
    best = (0, 0.0)
    for name, values in table.columns.items():
        known = values[np.isfinite(values)]
        steps = np.diff(known)
        if len(known) < FEWEST or (steps < 0.0).sum() > 2 or not (steps > 0.0).any():
            continue
        told = unit_of(table.units.get(name, ""))
        units = [told] if told in TIME_UNITS else list(TIME_UNITS)
        fitting = [one for one in units if one and fits(known * TIME_UNITS[one], RATES)]
        # Of two units that fit, the one with the rate nearer to those of most IMUs.
        rates = {one: 1.0 / (np.median(steps) * TIME_UNITS[one]) for one in fitting}
        unit = min(rates, key=lambda one: abs(np.log(rates[one] / 200.0)), default=None)
        even = float((steps > 0.0).mean())
        score = _likeness([name], "time"), even
        if unit is not None and score > best and even > 0.5:
            best, table.time, table.time_unit, table.rate = score, name, unit, rates[unit]


def _grouped(table: Table, letters: str) -> Iterator[list[str]]:
    """Yield the columns whose names differ in one place alone, by x, y, z or by numbers from 0 or
    1.
    """
    names, seen = table.columns.keys(), set()
    for name in names:
        for k, character in enumerate(name):
            for first in (letters[0], letters[0].upper(), "0", "1"):
                if character != first or (name[k - 1 : k].isdigit() and first in "01"):
                    continue
                if first in "01":
                    items = [str(int(first) + j) for j in range(len(letters))]
                else:
                    items = list(letters.upper() if first.isupper() else letters)
                found = [f"{name[:k]}{item}{name[k + 1 :]}" for item in items]
                if all(one in names for one in found) and tuple(found) not in seen:
                    seen.add(tuple(found))
                    yield found


def _likeness(names: Sequence[str], word: str) -> int:
    """Return how much the first of these names is like a word's: 0 for not at all."""
    parts = "".join(c if c.isalpha() else " " for c in names[0].lower()).split()
    found = 0
    for part in parts:
        bare = part[:-1] if len(names) > 1 and part[-1] in "wxyz" else part
        for place, start in enumerate(WORDS[word]):
            alike = start in (part, bare) if len(start) < 3 else part.startswith(start)
            found = max(found, alike * (len(WORDS[word]) - place))
    return found


def _values(table: Table, names: Sequence[str]) -> Array:
    found = np.stack([table.columns[one] for one in names], axis=1)
    return found[np.isfinite(found).all(axis=1)]


def _force_unit(table: Table, names: Sequence[str]) -> str | None:
    """Return the unit in which the median length is gravity."""
    values = _values(table, names)
    if len(values) < FEWEST:
        return None
    median = float(np.median(np.linalg.norm(values, axis=1)))
    if np.linalg.norm(values.mean(axis=0)) < STEADY * median:
        return None
    low, high = LIKELY_FORCE
    return next((k for k, u in FORCE_UNITS.items() if low < median * u / GRAVITY < high), None)


def _is_force(table: Table, names: list[str]) -> bool:
    others = ("angular_velocity", "position", "velocity", "quaternion")
    named = _likeness(names, "specific_force")
    return _force_unit(table, names) is not None and (
        named > 0 or not any(_likeness(names, one) for one in others)
    )


def _is_turning(table: Table, names: list[str]) -> bool:
    values = _values(table, names)
    largest = np.percentile(np.abs(values), 99.0) if len(values) else np.inf
    told = unit_of(table.units.get(names[0], ""))
    return bool(0.0 < largest < LARGEST_RATE / min(RATE_UNITS.values())) and (
        told in RATE_UNITS or _likeness(names, "angular_velocity") > 0
    )


def _is_smooth(table: Table, names: list[str]) -> bool:
    values = _values(table, names)
    if len(values) < FEWEST:
        return False
    step, spread = np.std(np.diff(values, axis=0)), np.std(values - values.mean(axis=0))
    return bool(0.0 < step < SMOOTH * spread)


def _is_unit_length(table: Table, names: list[str]) -> bool:
    values = _values(table, names)
    are_one = np.abs(np.linalg.norm(values, axis=1) - 1.0) < 0.02
    return len(values) >= FEWEST and float(are_one.mean()) > 0.95


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
            yield f'specific_force_unit = "{_force_unit(table, names)}"  # its length is gravity'
        elif word == "angular_velocity":
            yield _written_rate(table, names, turning_is_known)
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
    largest = float(np.percentile(np.abs(_values(table, names)), 99.9))
    unit = "deg/s" if largest > LARGEST_RATE else "rad/s"
    return f'angular_velocity_unit = "{unit}"  # guessed: it reaches {largest:.3g}; check this'


def _quoted(name: str) -> str:
    return json.dumps(name, ensure_ascii=False)


def _reason(section: str, table: Table, word: str, names: list[str]) -> str:
    where = f" of {table.name}" if table.name else ""
    length = np.median(np.linalg.norm(_values(table, names), axis=1))
    rate = f"{table.rate:.4g} Hz by {table.time} in {table.time_unit}"
    return f"[{section}] {word}: {', '.join(names)}{where}, {rate}, median length {length:.4g}"


def _told(table: Table) -> str:
    """Return what a table has, for a person who has to name its columns."""
    names, rows = list(table.columns), len(next(iter(table.columns.values())))
    shown = ", ".join(names[:12]) + f" and {len(names) - 12} more" * (len(names) > 12)
    rate = f" at {table.rate:.3g} Hz" if table.time else " without a time"
    return f"{table.name or 'a table'} ({rows} rows{rate}: {shown})"
