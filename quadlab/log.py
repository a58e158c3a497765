"""`quadlab log info|recover|report LOG`: what a log holds, mending a torn one, its report."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadlab.processes import Folder
from quadrotor.errors import StorageError, UsageError
from quadrotor.parameters import ParameterValue


@dataclass
class LogCommand:
    """Look at or mend a log, or write its report."""

    action: Annotated[Literal["info", "recover", "report"], tyro.conf.Positional]
    """what to do"""
    file: Annotated[Path, tyro.conf.Positional]
    """the MCAP file"""
    out: Folder = None
    """of report: folder for it (default: beside the log)"""
    pdf: bool = True
    """of report: also as PDF"""

    def run(self) -> int:
        if self.action != "report" and (self.out is not None or not self.pdf):
            raise UsageError(f"--out and --no-pdf are of `log report`; this is `log {self.action}`")
        if not self.file.is_file():
            what = "a folder" if self.file.is_dir() else "no file"
            raise StorageError(f"{self.file} is {what}; give the path of an .mcap file")
        if self.action == "report":
            from console.reports.report import write_report

            folder = self.out or self.file.resolve().parent
            for path in write_report(self.file, folder, pdf=self.pdf, defaults=new_defaults):
                print(path)
            return 0
        if self.action == "recover":
            from vehicle_link.log.recovery import recover

            found = recover(self.file)
            if not found.torn:
                print(f"{self.file} is whole; nothing was changed")
            else:
                print(
                    f"{self.file} was torn ({found.reason}) and is mended in place: "
                    f"{found.messages} messages kept, {found.lost_bytes} bytes behind the tear "
                    f"and {found.damaged_chunks} damaged chunks lost"
                )
            return 0
        from vehicle_link.log.reader import read_log

        counts: Counter[str] = Counter()
        first, last = None, 0
        for message in read_log(self.file):
            counts[message.topic] += 1
            first = message.log_ns if first is None else first
            last = message.log_ns
        duration = (last - (first or 0)) * 1e-9
        print(f"{self.file}: {sum(counts.values())} messages in {duration:.1f} s")
        for topic, count in sorted(counts.items()):
            rate = count / duration if duration > 0 else 0.0
            print(f"  {topic:32} {count:8} {rate:8.1f} Hz")
        return 0


def new_defaults() -> dict[str, ParameterValue]:
    """Of every parameter of this version by name; those of the station begin with `station.`."""
    from console.parameters import StationTree
    from quadlab.simulated_flight import FlightParameters
    from quadrotor.parameters import ParameterStore

    trees = (FlightParameters(), StationTree())
    return {one.name: one.default for tree in trees for one in ParameterStore(tree).descriptions()}
