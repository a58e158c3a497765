"""`quadlab log export LOG`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from quadlab.log_commands.log_file import LogFile, check_log_file, progress_of
from quadlab.option_types import Folder, Names, optional
from quadrotor.errors import UsageError
from quadrotor.extension import Exporter, PageExporter
from quadrotor.extensions import registry

TABLES = registry().offers(Exporter)
PAGES = registry().offers(PageExporter, taken=TABLES)
FORMATS = (*TABLES, *PAGES)
if TYPE_CHECKING:
    FormatName = str
else:
    FormatName = Literal[FORMATS]


@dataclass
class Export:
    """Write a log as tables for other programs, times in s and ns, values in SI units; or as a
    page that replays it without a server."""

    file: LogFile
    """the MCAP file"""
    format: FormatName = "csv"
    """csv, parquet: a file a topic, units in its header or the fields' metadata; mat: one file;
    page: the replay page with the whole flight, opened from disk by a browser"""
    out: Folder = None
    """new folder for the files (default: next to the log, named after it and the format)"""
    topics: Annotated[tuple[str, ...], optional("TOPIC")] = ()
    """only these, by the last part of their names, like: --topics state imu"""
    begin: Annotated[float, tyro.conf.arg(name="from", metavar="S")] = 0.0
    """begin of what is exported, in s after the start"""
    end: Annotated[float, tyro.conf.arg(name="to", metavar="S")] = math.inf
    """its end, in s after the start"""
    derive: Names = ()
    """with --format page: a derived signal, as in the
    charts: 'speed = norm(state.velocity.x, state.velocity.y)'"""

    def run(self) -> int:
        from extensions.export.export import export

        check_log_file(self.file)
        folder = self.out or self.file.with_name(f"{self.file.stem}_{self.format}")
        topics = [part for word in self.topics for part in word.split(",") if part]
        if self.format in PAGES:
            return self._page(folder)
        if self.derive:
            raise UsageError("--derive is for --format page; a table has the log's own numbers")
        with progress_of(f"exporting {self.file.name}") as progress:
            done = export(
                self.file,
                folder,
                kind=self.format,
                topics=topics,
                begin=self.begin,
                end=self.end,
                progress=progress,
            )
        for line in done.problems:
            print(f"not exported: {line}")
        if done.missing:
            print(f"note: the log is incomplete ({done.missing}); the rest of it is exported")
        if done.note:
            print(f"note: {done.note}")
        for path in done.files:
            print(path)
        print(f"{done.rows} rows in {len(done.files)} files")
        return 1 if done.problems else 0

    def _page(self, folder: Path) -> int:
        if self.topics or self.begin or self.end != math.inf:
            raise UsageError("a page has the whole flight: leave out --topics, --from and --to")
        with progress_of(f"exporting {self.file.name}") as progress:
            files = PAGES[self.format].load()(self.file, folder, progress, self.derive)
        for path in files:
            print(path)
        return 0
