"""`quadlab log info|recover LOG`: what a log holds, and mending a torn one."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadrotor.errors import StorageError


@dataclass
class LogCommand:
    """Look at or mend a log."""

    action: Annotated[Literal["info", "recover"], tyro.conf.Positional]
    """what to do"""
    file: Annotated[Path, tyro.conf.Positional]
    """the MCAP file"""

    def run(self) -> int:
        if not self.file.is_file():
            what = "a folder" if self.file.is_dir() else "no file"
            raise StorageError(f"{self.file} is {what}; give the path of an .mcap file")
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
