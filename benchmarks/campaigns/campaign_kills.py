"""Campaigns whose workers, runs, schedulers and disks fail: their rows are those of a calm run.

    python -m benchmarks campaign_kills

Compiled flights, because they are cheap. Whatever is killed is killed with -9, at random moments in
the midst of flights, and the rest is flown by `resume`. The tables are compared byte for byte
without the columns that depend on the computer.
"""

from __future__ import annotations

import os
import random
import re
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import psutil
import pyarrow.parquet as pq

from benchmarks.harness import Report, Row, Size, Target
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.table import MACHINE
from extensions.campaigns.tests.dask_processes import SCHEDULER, dask, worker
from extensions.campaigns.tests.disturbed import kill_workers, rows_of, started, until

PLAN = """experiment = "closed_loop"
seeds = {seeds}
[fixed]
"experiment.duration" = {duration}.0
[factors]
"control.position.kp_xy" = [3.0, 4.0, 5.0, 6.0]
"simulator.payload" = [0.0, 0.1, 0.2, 0.3, 1.0]
"""
"""With the largest payload the vehicle does not get off the ground, and some flights fail."""
CELLS = 20
WORKERS = 2
SMALL_DISK = "96k"
"""Size of the disk that gets full: the rows of some tasks."""


@dataclass(frozen=True)
class Trouble:
    """A disturbed campaign: how it is begun and disturbed, and how it is flown to its end.

    Attributes:
        disturb: flies a plan into a folder; returns how often something was killed, or full.
        needs_root: whether it mounts a disk.
    """

    name: str
    disturb: Callable[[Path, Path, Size], int]
    needs_root: bool = False


def run(size: Size = Size.FULL) -> Report:
    """Fly the plan calmly, then with each trouble, and compare."""
    seeds, duration = size.of((50, 100), (10, 100), (1, 9))
    report = Report(
        "campaign_kills",
        "Campaigns whose processes and disks fail",
        [
            f"{CELLS * seeds} compiled flights of {duration} s, {WORKERS} workers; all kills are "
            "SIGKILL",
            "differing: rows that are not, byte for byte, those of the undisturbed run; twice: "
            "rows in two files at a kill; lines: of what is told when a run ends by itself",
        ],
    )
    with TemporaryDirectory(prefix="quadlab-kills-") as made:
        place = Path(made)
        plan = place / "plan.toml"
        plan.write_text(PLAN.format(seeds=seeds, duration=duration))
        _finish(started("run", plan, "--out", place / "calm", "--workers", WORKERS))
        calm = rows_as_bytes(place / "calm")
        wrong = 0
        for one in size.some(TROUBLES):
            if one.needs_root and os.geteuid() != 0:
                report.notes.append(f"{one.name}: left out, as only root mounts a disk")
                continue
            out = place / one.name.replace(" ", "_")
            began = time.monotonic()
            times, twice = one.disturb(plan, out, size), _twice(out)
            resumed = _resume(out)
            found = rows_as_bytes(out)
            differing = sum(a != b for a, b in zip(calm, found, strict=False))
            differing += abs(len(calm) - len(found))
            wrong += differing + twice
            report.rows.append(
                Row(
                    one.name,
                    {
                        "times": times,
                        "rows": len(found),
                        "differing": differing,
                        "twice": twice,
                        "resumed": resumed,
                        "s": time.monotonic() - began,
                    },
                )
            )
    report.targets.append(Target("rows that differ, are lost or twice", wrong, 0))
    report.notes.append(f"load of the machine at the end {os.getloadavg()[0]:.2f}")
    return report


def rows_as_bytes(path: Path) -> list[bytes]:
    """Return each row as bytes, without what depends on the computer."""
    table = CampaignFolder(path).table()
    kept = table.select([name for name in table.column_names if not name.startswith(MACHINE)])
    batches = kept.combine_chunks().to_batches(max_chunksize=1)
    return [bytes(batch.serialize()) for batch in batches]


def _twice(path: Path) -> int:
    """Return how many rows are in two files."""
    found = [
        k for one in (path / "rows").iterdir() for k in pq.read_table(one)["index"].to_pylist()
    ]
    return len(found) - len(set(found))


def _finish(run: subprocess.Popen[str]) -> str:
    """Wait for the end of a run; return what it complained of. Raises RuntimeError at a traceback,
    or at more than one line.
    """
    _, said = run.communicate()
    lines = [line for line in said.splitlines() if line.startswith("quadlab: ")]
    if "Traceback" in said or len(lines) > 1:
        raise RuntimeError(f"a run ended with {said}")
    return lines[0] if lines else ""


def _resume(out: Path) -> int:
    """Fly the rest; return 1 if there was any."""
    if CampaignFolder(out).is_whole():
        return 0
    if said := _finish(started("resume", out, "--workers", WORKERS)):
        raise RuntimeError(said)
    return 1


# ---------------------------------------------------------------------- troubles
def _workers_killed(plan: Path, out: Path, size: Size) -> int:
    flying = started("run", plan, "--out", out, "--workers", WORKERS)
    killed = kill_workers(flying, out, size.of(20, 4, 1), seed=1)
    _finish(flying)
    return killed


def _runs_killed(plan: Path, out: Path, size: Size) -> int:
    """Kill all processes of a run at once, as a power cut does, again and again."""
    chosen, killed = random.Random(2), 0
    for _ in range(size.of(5, 2, 1)):
        before = rows_of(out)
        flying = started("run", plan, "--out", out, "--workers", WORKERS)
        wait = time.monotonic() + chosen.uniform(0.0, 2.0)
        if not until(lambda: rows_of(out) > before and time.monotonic() > wait, flying):  # noqa: B023
            _finish(flying)
            break
        parent = psutil.Process(flying.pid)
        for one in [parent, *parent.children(recursive=True)]:
            with suppress(psutil.NoSuchProcess):
                one.kill()
        flying.communicate()
        killed += 1
    return killed


def _disk_full(plan: Path, out: Path, size: Size) -> int:
    """Fly on a disk that is too small, which then gets larger; the rows move to another one."""
    with _small_disk(out) as grow:
        said = _finish(started("run", plan, "--out", out, "--workers", WORKERS))
        is_full = "No space left on device" in said
        grow()
        if said := _finish(started("resume", out, "--workers", WORKERS)):
            raise RuntimeError(said)
        kept = out.with_name(f"{out.name}.kept")
        subprocess.run(["cp", "-r", out, kept], check=True)
    out.rmdir()
    kept.rename(out)
    return int(is_full)


@contextmanager
def _small_disk(place: Path) -> Iterator[Callable[[], object]]:
    """Mount a small disk in memory; yield what makes it larger. Needs root."""
    place.mkdir()
    mount = partial(subprocess.run, check=True)
    mount(["mount", "-t", "tmpfs", "-o", f"size={SMALL_DISK}", "none", place])
    try:
        yield partial(mount, ["mount", "-o", "remount,size=64m", place])
    finally:
        mount(["umount", place])


def _dask_killed(plan: Path, out: Path, size: Size) -> int:
    """Kill a worker of Dask, then its scheduler; another one flies the rest."""
    with ExitStack() as stack:
        address, scheduler = _scheduler(stack)
        workers = [stack.enter_context(worker(address, "--no-nanny"))[0] for _ in range(WORKERS)]
        flying = started("run", plan, "--out", out, "--dask", address)
        killed = 0
        for one in (workers[0], scheduler):
            before = rows_of(out)
            if not until(lambda: rows_of(out) > before, flying):  # noqa: B023
                break
            one.kill()
            killed += 1
        _finish(flying)
    with ExitStack() as stack:
        address, _ = _scheduler(stack)
        stack.enter_context(worker(address, "--no-nanny"))
        if said := _finish(started("resume", out, "--dask", address)):
            raise RuntimeError(said)
    return killed


def _scheduler(stack: ExitStack) -> tuple[str, Any]:
    process, line = stack.enter_context(dask(*SCHEDULER, until="Scheduler at:"))
    found = re.search(r"tcp://\S+", line)
    assert found is not None
    return found[0], process


TROUBLES = (
    Trouble("workers killed", _workers_killed),
    Trouble("whole runs killed", _runs_killed),
    Trouble("disk full", _disk_full, needs_root=True),
    Trouble("Dask's worker and scheduler killed", _dask_killed),
)
