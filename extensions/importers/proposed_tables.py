"""Proposals of what columns with unknown names mean, from their numbers, units and names."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from extensions.importers.checks import GRAVITY, LARGEST_RATE, LIKELY_FORCE
from extensions.importers.flights import FEWEST
from extensions.importers.readers.tables import Source
from extensions.importers.stamps import RATES, RATES_OF_IMU, fits
from extensions.importers.units import FORCE_UNITS, RATE_UNITS, TIME_UNITS, unit_of
from quadrotor.errors import LogFormatError
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
AXES, ITEMS, EULER = "xyz", "wxyz", ["yaw", "pitch", "roll"]
MOST_COLUMNS = 400  # of a table
STEADY = 0.5
"""Least length of the mean specific force relative to its median length."""
SMOOTH = 0.2
"""Largest step of a position relative to its deviation, both rms."""
BATTERY = (2.5, 70.0)  # V


@dataclass
class Table:
    """The numbers of a table and the quantities that were recognised in them."""

    name: str
    columns: dict[str, Array]  # (N,)
    units: dict[str, str]
    time: str = ""
    time_unit: str = "s"
    rate: float = 0.0  # Hz
    groups: dict[str, list[str]] = field(default_factory=dict)  # columns by meaning


def read_table(source: Source, name: str) -> Table | None:
    """Return the columns of a table that has enough rows, without those whose names occur twice."""
    known = source.columns(name)
    names = [one for one in known if known.count(one) == 1][:MOST_COLUMNS]
    with np.errstate(invalid="ignore"):
        columns = _columns(source, name, names)
    rows = len(next(iter(columns.values()), ()))
    return Table(name, columns, source.units) if rows >= FEWEST else None


def _columns(source: Source, table: str, names: list[str]) -> dict[str, Array]:
    """Return the columns that are numbers, (N,) each: all at once, as some files are decoded at
    each reading, or each by itself where some are words, or numbers with separators of thousands.
    """
    try:
        return dict(zip(names, source.read(table, names).T, strict=True)) if names else {}
    except LogFormatError:
        if len(names) == 1:
            return {}
        parts = (_columns(source, table, [one]) for one in names)
        return {name: values for part in parts for name, values in part.items()}


def find(table: Table) -> None:
    """Find the quantities of the columns of a table."""
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
    elif angles := next(_angles(table), None):
        table.groups["euler"] = angles
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


def _angles(table: Table) -> Iterator[list[str]]:
    """Yield the columns whose names differ in yaw, pitch and roll alone, none of them of rates."""
    for words in (EULER, [one.title() for one in EULER], [one.upper() for one in EULER]):
        for name in table.columns:
            found = [name.replace(words[0], one) for one in words]
            is_rate = _likeness([name], "angular_velocity") > 0
            if words[0] in name and not is_rate and table.columns.keys() >= set(found):
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


def values_of(table: Table, names: Sequence[str]) -> Array:
    found = np.stack([table.columns[one] for one in names], axis=1)
    return found[np.isfinite(found).all(axis=1)]


def force_unit(table: Table, names: Sequence[str]) -> str | None:
    """Return the unit in which the median length is gravity."""
    values = values_of(table, names)
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
    return force_unit(table, names) is not None and (
        named > 0 or not any(_likeness(names, one) for one in others)
    )


def _is_turning(table: Table, names: list[str]) -> bool:
    values = values_of(table, names)
    largest = np.percentile(np.abs(values), 99.0) if len(values) else np.inf
    told = unit_of(table.units.get(names[0], ""))
    return bool(0.0 < largest < LARGEST_RATE / min(RATE_UNITS.values())) and (
        told in RATE_UNITS or _likeness(names, "angular_velocity") > 0
    )


def _is_smooth(table: Table, names: list[str]) -> bool:
    values = values_of(table, names)
    if len(values) < FEWEST:
        return False
    step, spread = np.std(np.diff(values, axis=0)), np.std(values - values.mean(axis=0))
    return bool(0.0 < step < SMOOTH * spread)


def _is_unit_length(table: Table, names: list[str]) -> bool:
    values = values_of(table, names)
    are_one = np.abs(np.linalg.norm(values, axis=1) - 1.0) < 0.02
    return len(values) >= FEWEST and float(are_one.mean()) > 0.95
