"""Writers of logs killed (-9) at random moments: the station's recorder, the vehicle's own log."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator

from benchmarks.harness import Report, Size
from benchmarks.logs import killed_onboard, killed_recorder
from benchmarks.logs.killed_file import Kill, summary

KILLS = 50
WRITERS: dict[str, Callable[[int], Iterator[Kill]]] = {
    "station's recorder": killed_recorder.kills,
    "vehicle's comms": killed_onboard.kills,
}


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    report = Report(
        "killed_logs",
        "Logs of killed writers",
        [
            "kill -9 at a moment by chance while messages come at the full rate; then the next "
            "start's repair",
            "lost: from the last message in the mended file to the last one put",
            "mended: closed, marked, nothing missing before its end, sound by `quadlab log check`; "
            "every message read by mcap (checksums on) and decoded by rosbags",
        ],
    )
    for what, kills in WRITERS.items():
        found = []
        for kill in kills(size.of(KILLS, 3, 1)):
            found.append(kill)
            line = "; ".join(kill.problems) or "sound"
            print(f"{what} {len(found)}: {kill.lost_ms:.1f} ms lost, {line}", file=sys.stderr)
        row, targets, lines = summary(what, found)
        report.rows.append(row)
        report.targets += targets
        report.notes += lines
    return report
