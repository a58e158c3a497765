"""One flight in several files, as a logger writes that begins a new file after some megabytes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from extensions.importers.readers.tables import FileTables, Source
from quadrotor.errors import LogFormatError
from quadrotor.records import Array


class JoinedTables(FileTables):
    """The rows of several files, one behind another; a table may be missing in some of them."""

    def __init__(self, sources: Sequence[Source]) -> None:
        super().__init__(sources[0].path)
        self._sources = list(sources)
        self.units = sources[0].units
        self.events = [event for one in sources for event in one.events]
        for one in sources:
            self.unreadable |= one.unreadable
        self._update()

    def _update(self) -> None:
        """Take over what the files know about themselves, some of it only when they are read."""
        first, found = self._sources[0], self._sources
        self.epoch_ns = first.epoch_ns
        self.torn = next((f"{one.path.name}: {one.torn}" for one in found if one.torn), "")
        for note in (note for one in found for note in one.notes):
            self.note(note)

    def tables(self) -> list[str]:
        return list(dict.fromkeys(name for one in self._sources for name in one.tables()))

    def columns(self, table: str) -> list[str]:
        first, *others = (one.columns(table) for one in self._having(table))
        return [name for name in first if all(name in one for one in others)]

    def read(self, table: str, names: list[str]) -> Array:
        found = np.concatenate([one.read(table, names) for one in self._having(table)])
        self._update()
        return found

    def remainders(self, table: str, name: str) -> Array | None:
        found = [one.remainders(table, name) for one in self._having(table)]
        if all(one is None for one in found):
            return None
        return np.concatenate(
            [
                np.zeros(len(source.read(table, [name]))) if one is None else one
                for source, one in zip(self._having(table), found, strict=True)
            ]
        )

    def _having(self, table: str) -> list[Source]:
        return [one for one in self._sources if table in one.tables()]

    def put_in_order(self, table: str, time: str) -> list[str]:
        """Put the files in the order of their times, and return a note on what is missing between
        two of them.

        Raises LogFormatError for files whose times overlap.
        """
        spans = []
        having = self._having(table)
        for one in having:
            times = one.read(table, [time])[:, 0]
            times = times[np.isfinite(times)]
            if not len(times):
                raise LogFormatError(f"{one.path.name} has no row with a time: leave it out")
            step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
            spans.append((float(times[0]), float(times[-1]), step, one))
        spans.sort(key=lambda span: span[:2])
        self._sources = [one for *_, one in spans] + [
            one for one in self._sources if one not in having
        ]
        notes = []
        for (_, end, step, before), (start, _, _, after) in itertools.pairwise(spans):
            names = f"{before.path.name} and {after.path.name}"
            if start <= end:
                raise LogFormatError(
                    f"{names} are not parts of one flight: the second begins at {start:.9g} of its "
                    f"{time!r}, the first ends at {end:.9g}; import each as a run of its own"
                )
            unit = self.units.get(time, "")
            missing = start - end - step
            if missing > step:
                notes.append(
                    f"between {names} {missing:.6g} {unit or f'of {time!r}'} are missing".rstrip()
                )
        return notes
