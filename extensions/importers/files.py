"""The files of one import: the times and columns that a mapping names."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from extensions.importers.flights import FEWEST, Flights
from extensions.importers.mapping import Columns, Mapping, Rows, column_names
from extensions.importers.physics import measurable
from extensions.importers.readers.formats import source_of
from extensions.importers.readers.joined import JoinedTables
from extensions.importers.readers.tables import Source
from extensions.importers.stamps import RATES, RATES_OF_IMU, continued, judged_seconds
from extensions.importers.units import TIME_UNITS, unit_of
from quadrotor.errors import LogFormatError, StorageError
from quadrotor.records import Array


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
            found = [self._stack.enter_context(source_of(one, self._wanted)) for one in paths]
            source = self._opened[path] = found[0] if len(found) == 1 else JoinedTables(found)
            self.notes += source.notes
        return self._opened[path]

    def read(
        self, rows: Rows, section: str, columns: dict[str, tuple[Columns, int]]
    ) -> list[Array]:
        """Return the times (N,), s, then each of `columns`, given by names and count."""
        source = self.source(rows)
        where = f"{source.path.name}, [{section}]"
        if rows.table not in source.tables():
            tables = ", ".join(sorted(filter(None, source.tables()))[:20]) or "none"
            raise LogFormatError(f"{where}: there is no table {rows.table!r}; there are {tables}")
        known = source.columns(rows.table)
        if rows.time is not None:
            columns = {"time": (rows.time, 1), **columns}
        names = {
            word: column_names(asked, known, count, f"{where} {word}")
            for word, (asked, count) in columns.items()
        }
        if isinstance(source, JoinedTables) and "time" in names:
            self.notes += source.put_in_order(rows.table, names["time"][0])
        table = source.read(rows.table, [one for found in names.values() for one in found])
        self._check_whole(source)
        edges = np.cumsum([len(found) for found in names.values()])[:-1]
        parts = dict(zip(names, np.split(table, edges, axis=1), strict=True))
        certain = False
        if rows.time is None:
            seconds = np.arange(len(table)) / (rows.rate or 1.0)
        else:
            certain = self._check_unit(source, names["time"][0], rows.time_unit, where)
            seconds = parts.pop("time")[:, 0]
        known_rows = np.isfinite(seconds) & np.isfinite(table).all(axis=1)
        if lost := int((~known_rows).sum()):
            self.notes.append(f"{where}: {lost} of {len(seconds)} rows without numbers left out")
        possible, notes = measurable(parts, rows, where)
        known_rows &= possible
        self.notes += notes
        seconds, kept = self._rising(seconds, known_rows, rows, section, where, certain=certain)
        return [seconds * rows.time_scale, *(one[kept] for one in parts.values())]

    def _check_unit(self, source: Source, name: str, stated: str, where: str) -> bool:
        """Return whether the file tells the unit of its time. Raises LogFormatError where it is
        another one than the mapping's.
        """
        written = source.units.get(name, "")
        if (told := unit_of(written)) and told != stated and told in TIME_UNITS:
            raise LogFormatError(
                f"{where}: the header has {name!r} in {written}, the mapping in {stated}: write "
                f'time_unit = "{told}", or correct the header'
            )
        return told == stated

    def _rising(
        self,
        stamps: Array,
        known: npt.NDArray[np.bool_],
        asked: Rows,
        section: str,
        where: str,
        *,
        certain: bool,
    ) -> tuple[Array, npt.NDArray[np.int64]]:
        """Return rising times of the flight in s without duplicates, and their rows in the table.

        Raises LogFormatError.
        """
        unit = "s" if asked.time is None else asked.time_unit
        fewest = 1 if section == "battery" else FEWEST
        rows = np.flatnonzero(known)
        self._check_count(len(rows), fewest, where)
        stamps, notes = continued(stamps[known], rows + 1, where)
        chosen = self._flight_in(stamps * TIME_UNITS[unit], section, asked, where)
        stamps, rows = stamps[chosen], rows[chosen]
        self._check_count(len(rows), fewest, where)
        self.notes += notes
        seconds = stamps * TIME_UNITS[unit]
        if len(rows) > 1:
            rates = RATES_OF_IMU if section == "imu" else RATES
            seconds = judged_seconds(stamps, unit, rows + 1, rates, where, certain=certain)
        kept = np.concatenate([[True], np.diff(seconds) > 0.0])
        if same := int((~kept).sum()):
            self.notes.append(f"{where}: {same} rows with the stamp of the row before left out")
        if kept.sum() < fewest:
            raise LogFormatError(f"{where}: {kept.sum()} different stamps in {len(seconds)} rows")
        return seconds[kept], rows[kept]

    def _flight_in(
        self, seconds: Array, section: str, asked: Rows, where: str
    ) -> slice | npt.NDArray[np.int64]:
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
