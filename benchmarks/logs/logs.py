"""A log of 20 minutes: checked, exported, reported, opened, each in a separate process.

    python -m benchmarks logs [--quick]

The log is synthetic (benchmarks/logs/recorded_run.py). For comparison the mcap library's own reader
iterates over all messages of the same file and does nothing with them. The columns of the log are
made once, separately, and read by the commands that follow.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.logs.recorded_run import MadeRun, write_run
from quadrotor.checkout import ROOT

DURATION_S = 1200.0, 60.0, 5.0  # of each size
MOST_S, MOST_MB = 20.0, 300.0
PLAIN = "mcap's own reader"
READ = """
import sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    print(sum(1 for _ in make_reader(file).iter_messages(log_time_order=False)))
"""
COLUMNS = "columns, made"
MAKE = """
import sys
from pathlib import Path
from flight_log.columns.log_columns import read_columns
read_columns(Path(sys.argv[1]))
"""
PAGE = """
import sys
from pathlib import Path
from extensions.replay.build import build_replay
from extensions.replay.reader import Replay
build_replay(Path(sys.argv[1]), lambda share: None)
Replay(Path(sys.argv[1])).window(["state.position.z", "state.yaw"], 0.0, 1e6, 1000)
"""
TABLE = """
import sys, time
import quadlab
run = quadlab.open(sys.argv[1])
began = time.process_time()
run["state"]["pose.pose.position.z"].sum()
print(time.process_time() - began)
"""
MOST_TABLE_S = 0.5
LIMITED = ("log check", "log export --format parquet")
"""Commands with a limit of time; memory is limited for all of ours."""


class Taken(NamedTuple):
    seconds: float
    busy: float  # s of processor time
    megabytes: float  # peak


def run(size: Size = Size.FULL) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    duration = size.of(*DURATION_S)
    with tempfile.TemporaryDirectory(prefix="quadlab-logs-") as name:
        log = write_run(Path(name) / "run.mcap", MadeRun(duration))
        out = Path(name) / "out"
        os.environ["XDG_CACHE_HOME"] = str(Path(name) / "cache")
        taken = {PLAIN: measured(sys.executable, "-c", READ, str(log))}
        taken[COLUMNS] = measured(sys.executable, "-c", MAKE, str(log))
        taken["replay page"] = measured(sys.executable, "-c", PAGE, str(log))
        for command in (*LIMITED, "log export --format csv", "log report"):
            words = command.split()
            if words[1] != "check":
                words += ["--out", str(out / "_".join(words))]
            words.insert(2, str(log))
            taken[command] = measured(sys.executable, "-m", "quadlab", *words)
        words = [sys.executable, "-c", TABLE, str(log)]
        table = float(subprocess.run(words, cwd=ROOT, capture_output=True, check=True).stdout)
        megabytes = log.stat().st_size / 1e6
    report = _report(taken, duration, megabytes)
    report.targets.append(Target('quadlab.open(run)["state"]: s', table, MOST_TABLE_S))
    return report


def _report(taken: dict[str, Taken], duration: float, megabytes: float) -> Report:
    report = Report(
        "logs",
        "A log of 20 minutes",
        [
            f"{duration / 60:.0f} min as the station records them, {megabytes:.0f} MB; each "
            "command in a process of its own, its start included",
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


MEASURE = """
import json, os, subprocess, sys, time
began = time.monotonic()
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
busy = usage.ru_utime + usage.ru_stime
found = time.monotonic() - began, busy, usage.ru_maxrss * 1024 / 1e6
print(json.dumps((os.waitstatus_to_exitcode(status), *found)))
"""
"""Program that runs another one, as the kernel counts the memory of a parent to its child."""


def measured(*words: str) -> Taken:
    """Run a process, whose modules are compiled once, and measure it. Raises RuntimeError when it
    fails.
    """
    command = [sys.executable, "-c", MEASURE, *words]
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, check=True, env=kept)
    status, seconds, busy, megabytes = json.loads(done.stdout)
    if status:
        raise RuntimeError(f"{' '.join(words)} ended with {status}")
    return Taken(seconds, busy, megabytes)
