"""The files of one import: the times and columns that a mapping names."""

from __future__ import annotations

from collections.abc import Mapping as Mapping_
from collections.abc import Sequence
from contextlib import ExitStack
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from extensions.importers.flights import FEWEST, Flights
from extensions.importers.mapping import CLOCK, CLOCK_TOPIC, Columns, Mapping, Rows, column_names
from extensions.importers.physics import measurable
from extensions.importers.readers.formats import source_of
from extensions.importers.readers.joined import JoinedTables
from extensions.importers.readers.progress import each
from extensions.importers.readers.ros_bags import LOGGED
from extensions.importers.readers.tables import Source
from extensions.importers.rows import Mask, Places, complete, keep, steps_where
from extensions.importers.stamps import RATES, RATES_OF_IMU, continued, judge, without_strays
from extensions.importers.units import FORCE_UNITS, LENGTH_UNITS, RATE_UNITS, TIME_UNITS, unit_of
from quadrotor.errors import LogFormatError, StorageError
from quadrotor.records import Array

UNITS = {
    "time": TIME_UNITS,
    "angular_velocity": RATE_UNITS,
    "specific_force": FORCE_UNITS,
    "position": LENGTH_UNITS,
}
"""Units that a file may tell of the columns of a word of the mapping."""
FINEST = 0.5e-9
"""s by which stamps may be rounded."""
COARSE = 0.3
"""Share of rows with the stamp of the row before from which on stamps are taken for rounded."""


class Files:
    """The files of one import, each opened once.

    Args:
        paths: the files of the flight; tables that a mapping finds in other files are next to the
            first one.
        flight: which flight of several is read, from 1; None: there is one.
    """

    def __init__(
        self, paths: Sequence[Path], mapping: Mapping, *, torn: bool, flight: int | None = None
    ) -> None:
        self._paths, self._wanted, self._torn = paths, mapping.tables(), torn
        self.flights = Flights(flight)
        self._opened: dict[Path, Source] = {}
        self._stack = ExitStack()
        self.notes: list[str] = []
        self._base: Fraction | None = None

    @property
    def base_ns(self) -> int:
        """The time of the first row that was read, ns on the clock of its file."""
        return round((self._base or 0) * 10**9)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def source(self, rows: Rows) -> Source:
        path = self._paths[0].parent / rows.file if rows.file else self._paths[0]
        if path not in self._opened:
            if rows.file and not path.exists():
                raise StorageError(f"{path}, which the mapping names, is not a file")
            paths = [path] if rows.file else self._paths
            found = [self._stack.enter_context(source_of(one, self._wanted)) for one in each(paths)]
            source = self._opened[path] = found[0] if len(found) == 1 else JoinedTables(found)
            self.notes += source.notes
        return self._opened[path]

    def read(
        self, rows: Rows, section: str, columns: dict[str, tuple[Columns, int]]
    ) -> list[Array]:
        """Return the times (N,), s since the first row that was read from the files, then each of
        `columns`, given by names and count.
        """
        source = self.source(rows)
        where = f"{source.path.name}, [{section}]"
        self._check_table(source, rows.table, where)
        known = source.columns(rows.table)
        is_by_clock = rows.time == CLOCK and CLOCK not in known
        if rows.time is not None:
            columns = {"time": (LOGGED if is_by_clock else rows.time, 1), **columns}
        names = {
            word: column_names(asked, known, count, f"{where} {word}")
            for word, (asked, count) in columns.items()
        }
        noted = len(source.notes)
        if isinstance(source, JoinedTables) and "time" in names:
            self.notes += source.put_in_order(rows.table, names["time"][0])
        with np.errstate(invalid="ignore"):  # a NaN of any kind
            table = source.read(rows.table, [one for found in names.values() for one in found])
        self.notes += source.notes[noted:]
        self._check_whole(source)
        edges = np.cumsum([len(found) for found in names.values()])[:-1]
        parts = dict(zip(names, np.split(table, edges, axis=1), strict=True))
        certain = self._check_units(source, names, rows, where)
        if rows.time is None:
            stamps = np.arange(len(table)) / (rows.rate or 1.0)
        else:
            stamps = parts.pop("time")[:, 0]
        if is_by_clock:
            stamps = _by_clock(source, stamps, where)
        known_rows, notes = complete(stamps, table, names, where)
        possible, more = measurable(parts, rows, where)
        known_rows &= possible
        self.notes += notes + more
        unit = "s" if rows.time is None else rows.time_unit
        found, kept = self._rising(stamps, known_rows, rows, section, where, certain=certain)
        self._check_fineness(stamps, known_rows, parts, section, where)
        rest = None
        if (
            rows.time is not None
            and not is_by_clock
            and np.spacing(max(-found[0], found[-1])) * TIME_UNITS[unit] > FINEST
        ):
            rest = source.remainders(rows.table, names["time"][0])
        seconds = self._since_base(
            found, None if rest is None else rest[kept], unit, rows.time_scale
        )
        keep(table, kept)
        return [seconds, *(one[: len(kept)] for one in parts.values())]

    @staticmethod
    def _check_table(source: Source, table: str, where: str) -> None:
        """Raise LogFormatError where a file has no such table, or one that cannot be read."""
        if table in source.unreadable:
            raise LogFormatError(f"{where}: {table} cannot be read: {source.unreadable[table]}")
        if table in source.tables():
            return
        tables = ", ".join(sorted(filter(None, source.tables()))[:20]) or "none"
        why = f"; it is incomplete: {source.torn}" if source.torn else ""
        why += "".join(f"; {note}" for note in source.notes[:2])
        raise LogFormatError(f"{where}: there is no table {table!r}; there are {tables}{why}")

    def _since_base(self, stamps: Array, rest: Array | None, unit: str, scale: float) -> Array:
        """Return times in s since the first row that was read, which become the base if there is
        none, without the rounding of large numbers.

        Args:
            stamps: (N,), in `unit`. rest: by how much more they are, (N,).
            scale: of this clock to that of the base.
        """
        first = Fraction(stamps[0]) + Fraction(0.0 if rest is None else rest[0])
        in_seconds = Fraction(1, round(1.0 / TIME_UNITS[unit])) * Fraction(scale)
        if self._base is None:
            self._base = Fraction(round(first * in_seconds * 10**9), 10**9)
        steps: Array = stamps - stamps[0]
        if rest is not None:
            steps += rest - rest[0]
        steps *= TIME_UNITS[unit] * scale
        steps += float(first * in_seconds - self._base)
        return steps

    @staticmethod
    def _check_fineness(
        stamps: Array, known: Mask, parts: Mapping_[str, Array], section: str, where: str
    ) -> None:
        """Raise LogFormatError where many rows with other values have the stamp of the row before,
        as rounded stamps have.
        """
        stamps = stamps if known.all() else stamps[known]
        again = steps_where(stamps, lambda steps: steps == 0.0)
        if section == "battery" or len(again) <= COARSE * known.sum():
            return
        rows = np.concatenate([one[known] for one in parts.values()], axis=1)
        rounded = int((rows[again] != rows[again + 1]).any(axis=1).sum())
        if rounded > COARSE * len(rows):
            raise LogFormatError(
                f"{where}: {rounded} of {len(rows)} rows have other values and the stamp of the "
                "row before: the stamps have too few digits; write all of them, or give rate "
                "instead of time"
            )

    def _check_units(
        self, source: Source, names: Mapping_[str, Sequence[str]], rows: Rows, where: str
    ) -> bool:
        """Return whether the file tells the unit of its time. Raises LogFormatError where a unit is
        another one than the mapping's.
        """
        certain = False
        for word, columns in names.items():
            if word not in UNITS:
                continue
            stated = getattr(rows, f"{word}_unit", None)
            for name in columns:
                written = source.units.get(name, "")
                told = unit_of(written)
                certain |= word == "time" and told == stated
                if told in UNITS[word] and told != stated and isinstance(stated, str):
                    raise LogFormatError(
                        f"{where}: the file has {name!r} in {written}, the mapping in {stated}: "
                        f'write {word}_unit = "{told}", or correct the file'
                    )
        return certain

    def _rising(
        self, stamps: Array, known: Mask, asked: Rows, section: str, where: str, *, certain: bool
    ) -> tuple[Array, npt.NDArray[np.integer]]:
        """Return rising times of the flight without duplicates, in the file's unit, and their rows
        in the table.

        Raises LogFormatError.
        """
        unit = "s" if asked.time is None else asked.time_unit
        fewest = 1 if section == "battery" else FEWEST
        rows: npt.NDArray[np.integer] = np.flatnonzero(known)
        if len(known) < 2**31 - 1:
            rows = rows.astype(np.int32)
        self._check_count(len(rows), fewest, where)
        if len(rows) < len(stamps):  # a copy of a large table's may be more than there is room for
            stamps = stamps[rows]
        rows += 1
        fitting, strays = without_strays(stamps, rows, where)
        if strays:
            stamps, rows = stamps[fitting], rows[fitting]
        stamps, notes = continued(stamps, rows, where)
        chosen = self._flight_in(stamps * TIME_UNITS[unit], section, asked, where)
        stamps, rows = stamps[chosen], rows[chosen]
        self._check_count(len(rows), fewest, where)
        self.notes += strays + notes
        if len(rows) > 1:
            rates = RATES_OF_IMU if section == "imu" else RATES
            judge(stamps, unit, rows, rates, where, certain=certain)
        kept = np.concatenate([[True], stamps[1:] > stamps[:-1]])
        if same := int((~kept).sum()):
            self.notes.append(f"{where}: {same} rows with the stamp of the row before left out")
        if kept.sum() < fewest:
            raise LogFormatError(
                f"{where}: {kept.sum()} different stamps in {len(rows)} rows: have they too few "
                "digits?" + " --stamps log takes the times of logging" * (asked.time == "stamp")
            )
        rows -= 1
        return (stamps, rows) if kept.all() else (stamps[kept], rows[kept])

    def _flight_in(self, seconds: Array, section: str, asked: Rows, where: str) -> slice | Places:
        """Return the rows of the flight that is read. Raises LogFormatError."""
        if section == "imu":
            chosen, notes = self.flights.of_imu(seconds, where)
            self.notes += notes
            return chosen
        same = not asked.time_offset and asked.time_scale == 1.0
        return self.flights.of_track(seconds, where, same_clock=same)

    @staticmethod
    def _check_count(rows: int, fewest: int, where: str) -> None:
        if rows < fewest:
            raise LogFormatError(f"{where}: {rows} rows; at least {fewest} are needed")

    def _check_whole(self, source: Source) -> None:
        if not source.torn:
            return
        if not self._torn:
            raise LogFormatError(
                f"{source.path.name} is incomplete: {source.torn}; --torn imports the part before"
            )
        note = f"{source.path.name} is incomplete: {source.torn}; imported up to there"
        if note not in self.notes:
            self.notes.append(note)


def _by_clock(source: Source, logged: Array, where: str) -> Array:
    """Return the times of a simulated clock at which messages were logged, NaN before its first
    and after its last one. Raises LogFormatError.
    """
    columns = [LOGGED, "clock.sec", "clock.nanosec"]
    known = source.columns(CLOCK_TOPIC) if CLOCK_TOPIC in source.tables() else []
    if not {*columns} <= {*known}:
        raise LogFormatError(f"{where}: there is no topic {CLOCK_TOPIC} with times")
    at, seconds, nanoseconds = source.read(CLOCK_TOPIC, columns).T
    simulated = seconds + 1e-9 * nanoseconds
    found: Array = np.interp(logged, at, simulated, left=np.nan, right=np.nan)
    return found
