"""Campaigns: what the engine costs beside the flights, and how fast a million rows are read.

    python -m benchmarks campaigns

Costs are processor time, because other programs use the machine too. The start of workers is no
part of a rate: it begins with the first task that has ended.
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.harness import Report, Row, Size, Target
from extensions.batches.batch import Scenario, fly_batch
from extensions.campaigns.design import Cells
from extensions.campaigns.engines.local_engine import fly_locally
from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import Outcome, fly_task
from extensions.campaigns.folder import CampaignFolder
from extensions.campaigns.plan import read_plan
from extensions.campaigns.shard import WHOLE

COMPILED = 'experiment = "closed_loop"\nseeds = {seeds}\n'
EIGHT = 'experiment = "figure_eight"\nseeds = {seeds}\n'
DURATION, HOVER = 27.0, 8.0
"""Durations of the compiled flight and of its hover, s, as the options have them."""
ROWS = 1_000_000


@dataclass
class Clock:
    """The moments at which tasks have ended, and with how many flights."""

    ended: list[tuple[float, int]] = field(default_factory=list)

    def took(self, outcomes: Sequence[Outcome]) -> None:
        self.ended.append((time.perf_counter(), len(outcomes)))

    @property
    def rate(self) -> float:
        """Return flights a second after the first task."""
        (began, _), *others = self.ended
        return sum(count for _, count in others) / max(1e-9, self.ended[-1][0] - began)


@dataclass(frozen=True)
class Run:
    """A campaign that was flown: s of processor time of all its processes and of each flight."""

    rate: float
    processor: float
    each: list[float]

    @property
    def flights(self) -> float:
        return sum(self.each)


def run(size: Size = Size.FULL) -> Report:
    """Measure engines against the flights alone, and the reading of a million rows."""
    report = Report(
        "campaigns",
        "Campaigns",
        [
            "compiled: closed_loop, the 8 of 27 s with sensors and filter; the 8: figure_eight, "
            "the whole stack",
            "overhead: processor time of all processes that is not the flights', by the difference "
            "of a long and a short run, so that starts are no part of it",
            "rates: flights a second of wall time from the first task on",
        ],
    )
    with TemporaryDirectory(prefix="quadlab-campaigns-") as made:
        place = Path(made)
        _compiled(report, place, size)
        _whole_stack(report, place, size)
        _million(report, place, size)
    report.notes.append(f"load of the machine at the end {os.getloadavg()[0]:.2f}")
    return report


def _processor() -> float:
    """Return s of processor time of this process and of its children that have ended."""
    found = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in found)


def _begun(place: Path, plan: str) -> CampaignFolder:
    path = place / f"plan{time.monotonic_ns()}.toml"
    path.write_text(plan)
    file = read_plan(path)
    return CampaignFolder.begun(path.with_suffix(""), file, Cells(file.plan))


def _flown(place: Path, plan: str, fly: Callable[[Work], None]) -> Run:
    folder, clock = _begun(place, plan), Clock()
    before = _processor()
    work = Work(folder, WHOLE, range(folder.flights), clock.took)
    fly(work)
    work.write()
    folder.finish()
    after = _processor()
    table = folder.table()
    if set(table["verdict"].to_pylist()) != {"passed"}:
        raise RuntimeError(f"flights of the benchmark failed: {set(table['reason'].to_pylist())}")
    return Run(clock.rate, after - before, table["processor_s"].to_pylist())


@dataclass(frozen=True)
class Marginal:
    """The cost of a further flight, by the difference of a long and a short run.

    Attributes:
        cost: s of processor time of all processes. flight: s of the flight itself.
        rate: flights a second of wall time in the long run.
    """

    cost: float
    flight: float
    rate: float

    @property
    def overhead(self) -> float:
        """Return the percentage of processor time beside the flights'."""
        return 100 * (self.cost / self.flight - 1.0)


def _marginal(
    place: Path, plan: str, counts: tuple[int, int], fly: Callable[[Work], None]
) -> Marginal:
    short, long = (_flown(place, plan.format(seeds=count), fly) for count in counts)
    more = counts[1] - counts[0]
    return Marginal(
        (long.processor - short.processor) / more, (long.flights - short.flights) / more, long.rate
    )


def _compiled(report: Report, place: Path, size: Size) -> None:
    count, rounds = size.of((2_000, 5), (400, 3), (40, 1))
    plan = COMPILED.format(seeds=count)
    fly_batch([Scenario()], 1.0, threads=1)  # loads the machine code
    alone, engine = [], []
    for _ in range(rounds):
        began = time.process_time()
        fly_batch([Scenario(seed=k) for k in range(count)], DURATION, hover=HOVER, threads=1)
        alone.append(count / (time.process_time() - began))
        flown = _flown(place, plan, lambda work: fly_locally(work, 1))
        engine.append(1.0 / statistics.median(flown.each))
    ratio = statistics.median(b / a for a, b in zip(alone, engine, strict=True))
    report.rows += [
        Row("compiled, fly_batch alone", {"flights a CPU second": statistics.median(alone)}),
        Row("compiled, a worker", {"flights a CPU second": statistics.median(engine)}),
    ]
    report.targets.append(Target("compiled flights over fly_batch", ratio, 0.9, at_most=False))
    if size is not Size.SMOKE:
        counts = size.of((500, 4_500), (100, 900), (0, 0))
        further = _marginal(place, COMPILED, counts, lambda work: fly_locally(work, 1))
        report.rows.append(Row("compiled, engine of processes", {"overhead, %": further.overhead}))


def _whole_stack(report: Report, place: Path, size: Size) -> None:
    """Measure processor time: two workers have twice the rate of one if a flight costs the same
    in both, as a flight is one thread that never waits.
    """
    count = size.of(24, 6, 0)
    if not count:  # a flight in this process: does it still run?
        folder = _begun(place, EIGHT.format(seeds=1))
        found = fly_task(folder.task([0]))
        report.rows.append(Row("the 8, in this process", {"processor s": found[0].processor}))
        return
    one, two = (
        _marginal(place, EIGHT, (2, 2 + count), lambda work, n=n: fly_locally(work, n))  # type: ignore[misc]
        for n in (1, 2)
    )
    with _dask() as address:
        from extensions.campaigns.engines.dask_engine import fly_by_dask

        by_dask = _dask_overhead(place, count, lambda work: fly_by_dask(work, address))
    for words, further in (("1 worker", one), ("2 workers", two)):
        figures: dict[str, float | str] = {
            "processor s": further.flight,
            "overhead, %": further.overhead,
            "flights a second": further.rate,
        }
        report.rows.append(Row(f"the 8, {words}", figures))
    report.rows.append(Row("the 8, Dask", {"overhead, %": by_dask}))
    report.targets += [
        Target(
            "the 8, two workers over one, by processor time",
            2.0 * one.cost / two.cost,
            1.8,
            at_most=False,
        ),
        Target("the 8, overhead of processes, %", one.overhead, 3.0),
        Target("the 8, overhead of Dask, %", by_dask, 5.0),
    ]


@contextmanager
def _dask() -> Iterator[str]:
    """Yield the address of a scheduler with one worker."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


def _dask_overhead(place: Path, count: int, fly: Callable[[Work], None]) -> float:
    """Return the percentage of Dask's overhead; its processes are measured while they live."""
    import psutil

    def spent() -> float:
        every = [psutil.Process(), *psutil.Process().children(recursive=True)]
        return sum(sum(one.cpu_times()[:2]) for one in every)

    found = []
    for seeds in (2, 2 + count):  # the first one loads what each flight needs
        before = spent()
        flown = _flown(place, EIGHT.format(seeds=seeds), fly)
        found.append((spent() - before, flown.flights))
    return 100 * (found[1][0] / found[1][1] - 1.0)


# ---------------------------------------------------------------------- rows
def _million(report: Report, place: Path, size: Size) -> None:
    """Read made-up rows in a process of its own, as `quadlab campaign show` and the page do."""
    count = size.of(ROWS, ROWS, 20_000)
    folder = _begun(
        place,
        f'experiment = "closed_loop"\nseeds = {count // 200}\n[factors]\n'
        '"control.position.kp_xy" = { from = 2.0, to = 6.0, number = 20 }\n'
        '"simulator.payload" = { from = 0.0, to = 0.3, number = 10 }\n',
    )
    _write_rows(folder, count)
    done = subprocess.run(
        [sys.executable, "-c", READ, str(folder.path)], capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    report.rows.append(Row(f"{count} rows: summary, map, ECDF", found))
    report.targets += [
        Target("a million rows, processor s", found["processor s"], 1.0),
        Target("a million rows, memory beside the program's, MB", found["memory, MB"], 300.0),
    ]


READ = """
import json, sys, time
from pathlib import Path
import pyarrow.parquet, scipy.stats
from extensions.campaigns import distributions, folder, summary, table
def memory():
    status = Path("/proc/self/status").read_text()
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024
campaign = folder.CampaignFolder(Path(sys.argv[1]))
campaign.plan
empty, began = memory(), time.process_time()
rows = campaign.table(figures_only=True)
summary.summarize(campaign, rows)
values = table.numbers(rows, "position_rms_m")
distributions.ecdf(values)
kp, payload = campaign.plan.plan.varied
distributions.heat_map(campaign.cells, rows, "position_rms_m", kp, payload)
took = time.process_time() - began
print(json.dumps({"processor s": took, "memory, MB": memory() - empty, "program, MB": empty}))
"""


def _write_rows(folder: CampaignFolder, count: int) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    random = np.random.default_rng(1)
    cells, seeds = folder.cells, folder.plan.plan.seeds
    fell = random.random(count) < 0.01
    columns: dict[str, object] = {
        "index": np.arange(count),
        "seed": random.integers(0, 2**31, count),
    }
    for name in folder.plan.plan.varied:
        columns[name] = np.repeat(cells.column(name, np.arange(cells.number)), seeds)
    columns["verdict"] = pa.array(np.where(fell, "failed", "passed"))
    columns["reason"] = pa.array(np.where(fell, "crashed after 3.000 s", ""))
    for name in ("position_rms_m", "position_max_m", "yaw_rms_deg", "tilt_max_deg"):
        values = random.lognormal(-5.0, 0.3, count)
        columns[name] = pa.array(np.where(fell, np.nan, values), from_pandas=True)
    for name in ("wall_s", "processor_s"):
        columns[name] = random.random(count)
    for name in ("worker", "host"):
        columns[name] = pa.array(np.full(count, "1234"))
    judged = {"judged": json.dumps(["position_rms_m", "position_max_m", "yaw_rms_deg"])}
    table = pa.table(columns).replace_schema_metadata(judged)
    pq.write_table(table, folder.rows / "rows.parquet")
