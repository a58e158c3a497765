"""A log of 20 minutes: checked, exported, reported, each by its command in a process of its own.

    python -m benchmarks logs [--quick]

The log is made up (benchmarks/logs/recorded_run.py). Next to it the mcap library's own reader goes
through all messages of the same file and does nothing with them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import Report, Row, Target
from benchmarks.logs.recorded_run import MadeRun, write_run
from quadrotor.checkout import ROOT

DURATION_S, QUICK_S = 1200.0, 60.0
MOST_S, MOST_MB = 20.0, 300.0
PLAIN = "mcap's own reader"
READ = """
import sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    print(sum(1 for _ in make_reader(file).iter_messages(log_time_order=False)))
"""
LIMITED = ("log check", "log export --format parquet")
"""What has a limit of time; memory is limited for all of ours."""


class Taken(NamedTuple):
    seconds: float
    busy: float  # s of processor time
    megabytes: float  # most at once


def run(quick: bool = False) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    duration = QUICK_S if quick else DURATION_S
    with tempfile.TemporaryDirectory(prefix="quadlab-logs-") as name:
        log = write_run(Path(name) / "run.mcap", MadeRun(duration))
        out = Path(name) / "out"
        taken = {PLAIN: _taken(sys.executable, "-c", READ, str(log))}
        for command in (*LIMITED, "log export --format csv", "log report"):
            words = command.split()
            if words[1] != "check":
                words += ["--out", str(out / "_".join(words))]
            words.insert(2, str(log))
            taken[command] = _taken(sys.executable, "-m", "quadlab", *words)
        size = log.stat().st_size / 1e6
    return _report(taken, duration, size)


def _report(taken: dict[str, Taken], duration: float, size: float) -> Report:
    report = Report(
        "logs",
        "A log of 20 minutes",
        [
            f"{duration / 60:.0f} min as the station records them, {size:.0f} MB; each command in "
            "a process of its own, its start included",
            f"{PLAIN}: all messages, in the order of the file, nothing done with them",
            "report: page and PDF",
        ],
    )
    plain = taken[PLAIN]
    for what, one in taken.items():
        figures: dict[str, float | str] = {
            "s": one.seconds,
            "processor, s": one.busy,
            "MB": one.megabytes,
            "over the plain read": one.busy / plain.busy,
        }
        report.rows.append(Row(what, figures))
        if what in LIMITED:
            report.targets.append(Target(f"{what}: s", one.seconds, MOST_S))
        if what != PLAIN:
            report.targets.append(Target(f"{what}: MB", one.megabytes, MOST_MB))
    return report


def _taken(*words: str) -> Taken:
    """Raise RuntimeError when the process fails."""
    began = time.monotonic()
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {process.returncode}")
    return Taken(
        time.monotonic() - began, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6
    )
