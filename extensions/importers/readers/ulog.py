"""ULog, the log of PX4, read by PX4's library; a table for each topic, its instance K as NAME#K."""

from __future__ import annotations

import io
from collections.abc import Collection
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from extensions.importers.readers.tables import FileTables, beyond_float, foreign_reader
from quadrotor.errors import os_errors
from quadrotor.records import Array

DATED = "vehicle_gps_position"
"""The topic whose `time_utc_usec` gives the date."""
EARLIEST_US = 10**15
"""Microseconds since the epoch (2001); a receiver without a date reports less."""
Table = dict[str, npt.NDArray[Any]]
ERROR, WARNING, INFO = 40, 30, 20  # levels of rcl_interfaces/Log


class _Watched(io.BufferedReader):
    """A file that notes where a read returned less than requested."""

    short_at: int | None = None

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        # At the end of the file, reading the 3 bytes of a next head returns nothing.
        if size is not None and len(data) < size and (data or size != 3):
            self.short_at = self.tell()
        return data


class UlogTables(FileTables):
    """The topics `wanted` that the log has."""

    def __init__(self, path: Path, wanted: Collection[str]) -> None:
        """Read the log. Raises LogFormatError or StorageError."""
        from pyulog import ULog

        super().__init__(path)
        topics = sorted({name.partition("#")[0] for name in wanted} | {DATED})
        # The library prints what it finds wrong; `torn` says it.
        with (
            foreign_reader(path, "ULog"),
            os_errors(lambda why: f"cannot read {path}: {why}"),
            _Watched(io.FileIO(path)) as file,
            redirect_stdout(io.StringIO()),
        ):
            log = ULog(file, topics, disable_str_exceptions=True)
            if file.short_at is not None:
                self.torn = f"it ends within a message at byte {file.short_at}"
        self._data: dict[str, Table] = {}
        for one in log.data_list:
            name = f"{one.name}#{one.multi_id}" if one.multi_id else one.name
            before = self._data.get(name)  # of a logger that began to log the topic again
            self._data[name] = _joined(before, one.data) if before else one.data
        if log.dropouts:
            lost = [1e-3 * one.duration for one in log.dropouts]
            self.note(
                f"{path.name}: the logger lost {sum(lost):.2f} s in {len(lost)} drop-outs, the "
                f"longest of {max(lost):.2f} s"
            )
        if dated := self._data.pop(DATED, None):
            utc = dated.get("time_utc_usec", np.zeros(0))
            known = np.flatnonzero(utc > EARLIEST_US)
            if len(known):
                k = known[0]
                self.epoch_ns = 1000 * (int(utc[k]) - int(dated["timestamp"][k]))
        self.events = [
            (1e-6 * one.timestamp, _level(one.log_level_str()), str(one.message).strip())
            for one in log.logged_messages
        ]

    def tables(self) -> list[str]:
        return list(self._data)

    def columns(self, table: str) -> list[str]:
        return list(self._data[table])

    def read(self, table: str, names: list[str]) -> Array:
        return np.stack([self._data[table][name].astype(np.float64) for name in names], axis=1)

    def remainders(self, table: str, name: str) -> Array | None:
        return beyond_float(self._data[table][name])


def _joined(one: Table, other: Table) -> Table:
    """Return the rows of two tables with the same columns, in the order of their stamps."""
    whole = {name: np.concatenate([one[name], other[name]]) for name in one}
    order = np.argsort(whole["timestamp"], kind="stable")
    return {name: column[order] for name, column in whole.items()}


def _level(name: str) -> int:
    if name in ("EMERGENCY", "ALERT", "CRITICAL", "ERROR"):
        return ERROR
    return WARNING if name == "WARNING" else INFO
