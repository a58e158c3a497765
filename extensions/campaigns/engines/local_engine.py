"""Flights on the processes of this computer, each replaced when it dies."""

from __future__ import annotations

import os
import signal
import time
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context

from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import Outcome, Task, fly_task
from quadrotor.errors import JobError
from vehicle_link.jobs import die_with_parent

STARTS = 10
"""Deaths of a worker at its start, one after the other, after which the run is ended."""
LOOK = 1.0
"""s between two looks at tasks that last too long."""
NICE = 10
"""Niceness of workers: a page, and a flight, on the same computer go first."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def _begin(parent: int) -> None:
    """Prepare a worker: it ends with its parent, which alone hears Ctrl-C and a closed terminal."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    die_with_parent(parent)
    os.nice(NICE)


def _warm_up(needs_stack: bool) -> None:
    """Load, or compile, what every flight needs: it is no part of the first flight's time."""
    if not needs_stack:
        return
    from vehicle.flight.kernels import prepare
    from vehicle.simulator.parameters import SimulatorParameters
    from vehicle.simulator.simulated_vehicle import SimulatedVehicle
    from vehicle_link.messages import typestore

    _, later = prepare(lambda line: None)
    later.close()
    typestore()
    simulated = SimulatedVehicle(SimulatorParameters())
    simulated.warm_up()
    simulated.close()


@dataclass
class _Worker:
    """One process, in a pool of its own, so that its death is that of its own task alone.

    Attributes:
        warm: done when the process has started.
        is_late: whether it was killed because its task lasted too long.
        starts: how often it has died at its start since its last task.
    """

    pool: ProcessPoolExecutor | None = None
    future: Future[list[Outcome]] | None = None
    task: Task | None = None
    since: float = 0.0
    warm: Future[None] | None = None
    is_late: bool = False
    starts: int = 0

    def begin(self, task: Task) -> bool:
        """Give it a task; return whether it is there to take it."""
        if self.pool is None:
            self.pool = ProcessPoolExecutor(1, get_context("spawn"), _begin, (os.getpid(),))
            self.warm = None
        try:
            if self.warm is None:
                self.warm = self.pool.submit(_warm_up, task.needs_stack)
            self.future = self.pool.submit(fly_task, task)
        except BrokenProcessPool:  # it died without a task
            self.end()
            return False
        self.task, self.since, self.is_late = task, time.monotonic(), False
        return True

    def kill(self) -> None:
        """Kill the process; its future then tells of a broken pool."""
        processes = (self.pool and self.pool._processes) or {}
        for pid in list(processes):
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)

    def end(self) -> None:
        """Wait for the end of a process that was killed, or has died: a program that ends in the
        meantime would wait for it forever.
        """
        if self.pool is not None:
            self.pool.shutdown(wait=True, cancel_futures=True)
        self.pool = self.future = None


def fly_locally(work: Work, workers: int) -> None:
    """Fly all tasks. Raises StorageError when rows cannot be written."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    crew = [_Worker() for _ in range(workers)]
    try:
        while True:
            for one in crew:
                while one.future is None and (task := work.take(workers)) is not None:
                    if not one.begin(task):
                        work.back(task)
            busy = {one.future: one for one in crew if one.future is not None}
            if not busy:
                return
            done, _ = wait(busy, timeout=LOOK, return_when=FIRST_COMPLETED)
            for future in done:
                _ended(busy[future], work)
            for one in crew:
                _look(one, work)
    finally:
        for one in crew:
            one.kill()
        for one in crew:
            one.end()


def _ended(worker: _Worker, work: Work) -> None:
    future, task = worker.future, worker.task
    assert future is not None
    assert task is not None
    worker.future = None
    try:
        outcomes = future.result()
    except BrokenProcessPool:
        was_warm = worker.warm is not None and worker.warm.done() and not worker.warm.exception()
        worker.end()
        if not was_warm:  # it died while it started: that was not the flight
            worker.starts += 1
            if worker.starts >= STARTS:
                raise JobError(
                    f"{STARTS} workers died at their start, one after the other; is there memory "
                    "for them? --workers N starts fewer"
                ) from None
            work.back(task)
        elif worker.is_late:
            work.timed_out(task)
        else:
            work.died(task)
        return
    worker.starts = 0
    work.finished(outcomes)


def _look(worker: _Worker, work: Work) -> None:
    """Kill a worker whose task lasts too long."""
    if worker.future is None or worker.task is None or worker.is_late:
        return
    if worker.warm is not None and not worker.warm.done():
        worker.since = time.monotonic()
    elif time.monotonic() - worker.since > work.limit * len(worker.task.indices):
        worker.is_late = True
        worker.kill()
