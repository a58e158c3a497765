"""The folder of a campaign: its plan, what it was flown with, and its rows as Parquet files."""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from console.atomic_file import replacing
from extensions.campaigns.beginning import (
    LOCK,
    LOGS,
    MADE,
    PLAN,
    PROTOCOL,
    RECORD,
    ROWS,
    make,
    read_record,
    software,
    write_record,
)
from extensions.campaigns.design import Cells
from extensions.campaigns.flights import Outcome, Task
from extensions.campaigns.plan import COMPILED, OWN, PlanFile, read_plan
from extensions.campaigns.recorded import logs as over_logs
from extensions.campaigns.row_files import RowFiles
from extensions.campaigns.search.kept import read_trials
from extensions.campaigns.shard import WHOLE, Shard
from extensions.campaigns.table import array, figures, joined, numbers
from quadlab.data_folder import locked
from quadrotor.errors import StorageError, UsageError, os_errors

if TYPE_CHECKING:
    import pyarrow as pa

T = TypeVar("T")


class CampaignFolder:
    """A campaign on disk. Raises StorageError for a folder without one.

    Attributes:
        record: what it was begun with: plan, software, machine.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.record: dict[str, Any] = dict(read_record(path))
        if self.record.get("protocol") != PROTOCOL:
            raise StorageError(f"{path} is of another version of quadlab's campaigns; update it")
        self._files = RowFiles(path)
        self.rows = self._files.place
        self._begun = self._identity()
        self.flights: int = self.record["flights"]

    @cached_property
    def plan(self) -> PlanFile:
        return read_plan(self.path / PLAN, is_kept=True)

    @cached_property
    def cells(self) -> Cells:
        return Cells(self.plan.plan, dict(enumerate(read_trials(self.path).trials)))

    def task(self, indices: Sequence[int], *, keep_logs: bool = False) -> Task:
        """Return a task of these flights for a worker."""
        file, cells = self.plan, self.cells
        needs_stack = file.plan.experiment != COMPILED and not file.plan.logs
        needed = {cells.trial(index) for index in indices} if file.plan.search else set()
        trials = {number: cells.trials[number] for number in needed}
        where = str(self.path.absolute())
        return Task(file.text, where, tuple(indices), needs_stack, keep_logs, trials)

    def _identity(self) -> tuple[int, int]:
        """Return what tells the folder's record from that of another one at the same path."""
        with os_errors(lambda why: f"{self.path} is no longer there ({why})"):
            found = (self.path / RECORD).stat()
        return found.st_ino, found.st_mtime_ns

    # ------------------------------------------------------------------ beginning
    @classmethod
    def begun(cls, path: Path, file: PlanFile, cells: Cells) -> CampaignFolder:
        """Return the folder of this plan, made if it is new.

        Raises UsageError for a folder of another plan, StorageError if it cannot be written.
        """
        path = path.expanduser()
        if not (path / RECORD).exists():
            with os_errors(lambda why: f"--out {path} cannot be written ({why})"):
                if path.exists() and any(one.name not in MADE for one in path.iterdir()):
                    raise UsageError(f"--out {path} holds other files; give a new folder")
                make(path, file, cells)
        found = cls(path)
        if found.record["plan"] != file.identity:
            raise UsageError(
                f"{path} holds the campaign of another plan ({found.record['plan']}, this is "
                f"{file.identity}): a changed plan, or a changed file that it names, is a new "
                "campaign; give another --out"
            )
        found._check_software()
        if file.plan.logs:
            found._add_logs(file)
        return found

    def _add_logs(self, file: PlanFile) -> None:
        """Add the logs that were recorded since to the rows that are to be made."""
        logs = over_logs.with_later(over_logs.read_kept(self.path / OWN), file.logs)
        cells = Cells(file.with_logs(logs).plan)
        if cells.flights == self.flights:
            return
        with os_errors(lambda why: f"{self.path} cannot be written ({why})"):
            over_logs.keep(self.path / OWN, logs)
            self.record |= {"flights": cells.flights, "cells": cells.number}
            write_record(self.path, self.record)
        self.flights, self._begun = cells.flights, self._identity()

    def check_alike(self) -> None:
        """Raise UsageError if the rest would be flown by another plan, or other software."""
        self._check_software()
        if self.plan.identity != self.record["plan"]:
            raise UsageError(
                f"{self.path / PLAN} was changed since; undo that, or begin another campaign"
            )

    def _check_software(self) -> None:
        then, now = self.record["software"], software()
        if name := next((one for one in now if then.get(one) != now[one]), ""):
            raise UsageError(
                f"{self.path} was begun with another quadlab ({name} {then.get(name)}, revision "
                f"{self.record['revision']['git_revision'][:10]}; now {now[name]}): its rows would "
                "not be alike; fly it with that one, or begin another campaign"
            )

    @contextlib.contextmanager
    def owned(self, shard: Shard = WHOLE) -> Iterator[None]:
        """Hold the folder, or a shard of it. Raises StorageError while another run holds it."""

        def line(owner: str) -> str:
            return (
                f"another run (process {owner}) flies into {self.path}; wait for its end, stop it, "
                "or give this one its own --out"
            )

        with locked(self.path / LOCK, line, shared=shard != WHOLE):
            if shard == WHOLE:
                yield
            else:
                with locked(self.path / f"shard_{shard.name}.lock", line):
                    yield

    @property
    def is_running(self) -> bool:
        """Return whether a run of this computer holds the folder, or a shard of it.

        The kernel's list of locks is read: to try the lock would refuse a run that just begins.
        """
        try:
            inode = (self.path / LOCK).stat().st_ino
            held = Path("/proc/locks").read_text()
        except OSError:
            return False
        return re.search(rf"FLOCK .*:{inode} ", held) is not None

    # ------------------------------------------------------------------ rows
    def done(self) -> npt.NDArray[np.bool_]:
        """Return for each flight whether it has a row."""
        import pyarrow.parquet as pq

        def indices(parts: list[Path]) -> npt.NDArray[np.bool_]:
            found = np.zeros(self.flights, bool)
            for part in parts:
                with pq.ParquetFile(part) as file:
                    found[numbers(file.read(["index"]), "index")] = True
            return found

        return self.read_files(indices)

    def count(self) -> int:
        """Return the number of rows, from the ends of their files alone."""
        import pyarrow.parquet as pq

        def rows(parts: list[Path]) -> int:
            return sum(pq.read_metadata(part).num_rows for part in parts)

        return min(self.flights, self.read_files(rows))

    def read_files(self, reading: Callable[[list[Path]], T]) -> T:
        """Return the result of a function of the present files of rows. Raises StorageError."""
        with os_errors(lambda why: f"the rows of {self.path} cannot be read ({why})"):
            return self._files.read(reading)

    def add(self, outcomes: Sequence[Outcome], shard: Shard) -> None:
        """Write rows as one more file, and logs. Raises StorageError, as `check_there` does."""
        self.check_there()
        for one in outcomes:
            if one.log is not None:
                self.add_log(one)
        number = 1 + max((_number(part, shard) for part in self._files.paths), default=0)
        place = self.rows / f"{shard.name}-{number:06}.parquet"
        _write(place, self._table(outcomes))

    def check_there(self) -> None:
        """Raise StorageError for a folder that was deleted, or replaced, since it was opened."""
        if not self.rows.is_dir() or self._identity() != self._begun:
            raise StorageError(
                f"{self.path} was deleted or replaced while its flights were flown; the rows that "
                "were in it are lost: run the plan again"
            )

    def add_log(self, outcome: Outcome) -> None:
        """Keep the log of a flight, as the file `log_of`. Raises StorageError."""
        assert outcome.log is not None
        place = self.log_of(outcome.index)
        with os_errors(lambda why: f"{place} cannot be written ({why})"):
            place.parent.mkdir(exist_ok=True)
            with replacing(place) as new:
                new.write_bytes(outcome.log)

    def log_of(self, index: int) -> Path:
        """Return the place of a flight's log, if it is kept."""
        return self.path / LOGS / f"{index:07}.mcap"

    def _table(self, outcomes: Sequence[Outcome]) -> pa.Table:
        import pyarrow as pa

        plan, indices = self.plan.plan, np.array([one.index for one in outcomes])
        columns: dict[str, Any] = {
            "index": pa.array(indices, pa.int64()),
            "seed": pa.array([self.cells.seed(one.index) for one in outcomes], pa.int64()),
        }
        for name in plan.varied:
            columns[name] = array(self.cells.column(name, indices // plan.seeds))
        columns["verdict"] = pa.array([one.verdict for one in outcomes], pa.string())
        columns["reason"] = pa.array([one.reason for one in outcomes], pa.string())
        for name in sorted({name for one in outcomes for name in one.metrics}):
            values = [one.metrics.get(name) for one in outcomes]
            columns[name] = pa.array(values, pa.float64())
        columns["wall_s"] = pa.array([one.wall for one in outcomes], pa.float64())
        columns["processor_s"] = pa.array([one.processor for one in outcomes], pa.float64())
        columns["worker"] = pa.array([one.worker for one in outcomes], pa.string())
        columns["host"] = pa.array([one.host for one in outcomes], pa.string())
        judged = sorted({name for one in outcomes for name in one.judged})
        return pa.table(columns).replace_schema_metadata({"judged": json.dumps(judged)})

    def table(self, *, figures_only: bool = False) -> pa.Table:
        """Return all rows in the order of their index. Raises StorageError if there are none.

        Args:
            figures_only: whether what depends on the computer is left out, to save memory.
        """
        read = figures if figures_only else joined
        return self.read_files(lambda parts: read(parts, self.plan.plan.varied, self.path))

    def is_whole(self) -> bool:
        """Return whether all flights are flown; a search needs not all, as trials end early."""
        return read_trials(self.path).is_over or bool(self.done().all())

    def finish(self) -> bool:
        """Write all rows as one file in the order of their index, if all are there."""
        self.check_there()
        if not self.is_whole():
            return False
        if [part.name for part in self._files.paths] in ([], [f"{ROWS}.parquet"]):
            return True
        new = self._files.new
        with os_errors(lambda why: f"{new} cannot be written ({why})"):
            shutil.rmtree(new, ignore_errors=True)
            new.mkdir()
            _write(new / f"{ROWS}.parquet", self.table())
            self._files.replace()
        return True

    def mend(self) -> None:
        """Complete or remove what a killed run left unfinished; only for the folder's owner."""
        with os_errors(lambda why: f"{self.path} cannot be written ({why})"):
            self._files.mend()


def _write(place: Path, table: pa.Table) -> None:
    import pyarrow.parquet as pq

    with os_errors(lambda why: f"{place} cannot be written ({why})"), replacing(place) as new:
        pq.write_table(table, new)
        with new.open("rb") as file:  # on the disk before it gets its name
            os.fsync(file.fileno())


def _number(part: Path, shard: Shard) -> int:
    name, _, number = part.stem.rpartition("-")
    return int(number) if name == shard.name and number.isdigit() else 0
