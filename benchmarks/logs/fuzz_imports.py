"""Mutated files of all formats that `quadlab log import` reads.

    python -m benchmarks fuzz_imports [--count N] [--seed N]

Each file is imported by a process of its own, forked from one that has loaded the readers. A
problem is a traceback, a warning, a status that is none of 0, 1, 2, more than 30 s of processor
time, or more than 500 MB.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.logs import foreign_logs
from benchmarks.logs.foreign_logs import Format
from extensions.export.export import export
from extensions.importers.tests.foreign_flight import ForeignFlight, make_flight, write_mapping
from quadlab.__main__ import main
from tests.crafted_logs import mutated, sound

COUNT = 2000, 170, 17  # of each size
MOST_MB = 500.0
LONGEST = 30  # s of processor time
HANGS = 600  # s of a busy computer, after which a process that waits is ended
SECONDS = 6.0  # of a flight
FLIGHT = make_flight(seconds=SECONDS)


class Done(NamedTuple):
    """The result of one import."""

    status: int
    seconds: float  # of processor time
    peak: float  # MB
    said: str


def _exported(folder: Path, _: ForeignFlight) -> Path:
    return export(sound(folder / "sound.mcap"), folder / "out", "mat").files[0]


FORMATS = {
    **{name: one for name, one in foreign_logs.FORMATS.items() if name != "bag of ROS 2"},
    "exported mat": Format(_exported, ""),
}
"""Formats of single files, foreign ones and quadlab's own."""


def imported(file: Path, words: list[str], folder: Path) -> Done:
    """Import a file in a process of its own."""
    said = folder / "said.txt"
    process = os.fork()
    if not process:
        status = 99
        try:
            signal.alarm(HANGS)
            resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
            output = os.open(said, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
            os.dup2(output, 1), os.dup2(output, 2)
            status = main(["log", "import", str(file), *words, "--data", str(folder / "data")])
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)
    _, status, used = os.wait4(process, 0)
    return Done(
        os.waitstatus_to_exitcode(status),
        used.ru_utime + used.ru_stime,
        used.ru_maxrss * 1024e-6,
        said.read_text(errors="replace"),
    )


def is_problem(done: Done) -> bool:
    wrong = "Traceback" in done.said or re.search(r"\wWarning: ", done.said) is not None
    return wrong or done.status not in (0, 1, 2) or done.seconds > LONGEST or done.peak > MOST_MB


def run(size: Size = Size.FULL, count: int | None = None, seed: int = 0) -> Report:
    """Run the benchmark for `python -m benchmarks`."""
    count = count or size.of(*COUNT)
    problems: list[str] = []
    results: dict[str, list[Done]] = {name: [] for name in FORMATS}
    with tempfile.TemporaryDirectory(prefix="quadlab-fuzz-") as name:
        folder = Path(name)
        mapping = write_mapping(folder / "mapping.toml", 'angular_velocity_unit = "rad/s"')
        sounds = {}
        for kind, one in FORMATS.items():
            (folder / kind).mkdir()
            sounds[kind] = one.write(folder / kind, FLIGHT)
        for k in range(count):
            kind = list(FORMATS)[k % len(FORMATS)]
            whole, chosen = sounds[kind], FORMATS[kind].mapping
            file = folder / f"mutated{''.join(whole.suffixes)}"
            file.write_bytes(mutated(whole.read_bytes(), seed + k))
            named = str(mapping) if chosen == "file" else chosen
            words = [*(["--mapping", named] if chosen else []), *(["--torn"] if k % 2 else [])]
            done = imported(file, words, folder)
            results[kind].append(done)
            if is_problem(done):
                last = done.said.strip()[-300:]
                problems.append(
                    f"{kind}, mutation {seed + k}: status {done.status}, {done.seconds:.1f} s, "
                    f"{done.peak:.0f} MB, {last}"
                )
                print(problems[-1], file=sys.stderr)
            shutil.rmtree(folder / "data", ignore_errors=True)
            if k % 100 == 99:
                print(f"{k + 1} files, {len(problems)} problems", file=sys.stderr, flush=True)
    return _report(count, seed, results, problems)


def _report(count: int, seed: int, results: dict[str, list[Done]], problems: list[str]) -> Report:
    report = Report(
        "fuzz_imports",
        "Mutated files of other systems",
        [f"{count} files, mutations from number {seed}", *problems[:20]],
    )
    for kind, found in results.items():
        if found:
            values: dict[str, float | str] = {
                "files": len(found),
                "refused": sum(one.status != 0 for one in found),
                "most, s": max(one.seconds for one in found),
                "most, MB": max(one.peak for one in found),
            }
            report.rows.append(Row(kind, values))
    report.targets.append(Target("problems", len(problems), 0.0))
    return report
