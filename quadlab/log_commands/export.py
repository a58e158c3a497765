"""`quadlab log export LOG`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from quadlab.commands.option_types import Folder
from quadlab.log_commands.log_file import LogFile, check_log_file
from quadlab.log_commands.progress import progress_of


@dataclass
class Export:
    """Write a log as tables for other programs, times in s and ns, values in SI units."""

    file: LogFile
    """the MCAP file"""
    format: Literal["csv", "parquet", "mat"] = "csv"
    """csv, parquet: a file a topic, units in its header or the fields' metadata; mat: one file"""
    out: Folder = None
    """new folder for the files (default: next to the log, named after it and the format)"""
    topics: Annotated[tuple[str, ...], tyro.conf.arg(metavar="TOPIC")] = ()
    """only these, by the last part of their names, like: --topics state imu"""
    begin: Annotated[float, tyro.conf.arg(name="from", metavar="S")] = 0.0
    """s after the start"""
    end: Annotated[float, tyro.conf.arg(name="to", metavar="S")] = math.inf
    """s after the start"""

    def run(self) -> int:
        from console.log_export.export import export

        check_log_file(self.file)
        folder = self.out or self.file.with_name(f"{self.file.stem}_{self.format}")
        topics = [part for word in self.topics for part in word.split(",") if part]
        with progress_of(f"exporting {self.file.name}") as progress:
            done = export(self.file, folder, self.format, topics, self.begin, self.end, progress)
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
