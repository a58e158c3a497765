"""Flights on the workers of a Dask scheduler, which a laboratory or a centre of computing runs."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING

from extensions.campaigns.beginning import software
from extensions.campaigns.engines.work import Work
from extensions.campaigns.flights import Outcome, Task
from quadrotor.errors import LinkError, QuadlabError, UnreachableError, UsageError

if TYPE_CHECKING:
    from distributed import Client, Future, as_completed


Answer = tuple[str, list[Outcome]]
"""The reason why a worker is refused, empty if it is not, and the outcomes of a task."""
TLS = "DASK_DISTRIBUTED__COMM__TLS__"
"""Beginning of the variables of the environment with Dask's certificates."""
REACH = "10s"
"""Longest time in which a scheduler has to answer."""
WAITING = 2
"""Tasks for each thread of a worker: the next one is there when the last one ends."""
FIRST_WORKER = 30.0
"""s to wait for a first worker."""


def check_scheduler(address: str) -> None:
    """Raise UnreachableError, LinkError or UsageError if a scheduler's workers cannot fly."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise UsageError("--dask needs Dask: pip install 'quadlab[campaigns]'") from None
    with _client(address) as client:
        _check_workers(client, address)


def fly_by_dask(work: Work, address: str) -> None:
    """Fly all tasks, on workers that `check_scheduler` has accepted. Raises UnreachableError,
    LinkError, UsageError with the worker's name.
    """
    from concurrent.futures import CancelledError

    from distributed import as_completed
    from distributed.comm.core import CommClosedError

    try:
        with _client(address) as client:
            running: dict[Future[Answer], Task] = {}
            suspects: list[Task] = []
            ended = as_completed(loop=client.loop)
            while fill(work, client, running, ended) or suspects:
                if running:
                    future = next(ended)
                    task = running.pop(future)
                    if not _is_done(work, task, future):
                        suspects.append(task)
                    continue
                # each alone: a scheduler also blames what waited at a worker's death
                task = suspects.pop(0)
                if not _is_done(work, task, submitted(work, client, task)):
                    work.given_up(task.indices[0])
    except (CancelledError, CommClosedError):  # futures and connections, without a scheduler
        raise LinkError(
            "the scheduler of Dask has gone; the rows so far are kept: start it again, then "
            f"quadlab campaign resume {work.folder.path} --dask ADDRESS"
        ) from None


def fill(
    work: Work, client: Client, running: dict[Future[Answer], Task], ended: as_completed
) -> bool:
    """Give the workers tasks, some more than they have threads; return whether some are running."""
    threads = max(1, sum(client.nthreads().values()))
    while len(running) < WAITING * threads and (task := work.take(WAITING * threads)) is not None:
        future = submitted(work, client, task)
        running[future] = task
        ended.add(future)
    return bool(running)


def submitted(work: Work, client: Client, task: Task) -> Future[Answer]:
    """Return the future of a task that is given to the workers."""
    return client.submit(_by_value(), task, software(), work.limit, pure=False)


def _is_done(work: Work, task: Task, future: Future[Answer]) -> bool:
    """Take the outcomes of a task; return False for a single flight whose workers have died.

    Raises LinkError, StorageError, UsageError.
    """
    from concurrent.futures import CancelledError

    from distributed.comm.core import CommClosedError
    from distributed.scheduler import KilledWorker

    try:
        refusal, outcomes = future.result()
    except KilledWorker:  # as often as the scheduler allows
        if len(task.indices) == 1:
            return False
        work.died(task)
        return True
    except (QuadlabError, CancelledError, CommClosedError):
        raise
    except Exception as error:
        raise LinkError(f"a worker of Dask did not fly: {type(error).__name__}: {error}") from error
    if refusal:
        raise UsageError(refusal)
    work.finished(outcomes)
    return True


def _client(address: str) -> Client:
    from distributed import Client

    for name in ("distributed", "distributed.client"):  # what they log is told in one line here
        logging.getLogger(name).setLevel(logging.CRITICAL)
    _check_certificates(address)
    try:
        return Client(address, timeout=REACH, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UnreachableError(
            f"no scheduler of Dask answers at {address} ({str(error).splitlines()[0]}); start "
            "`dask scheduler` and `dask worker`, or correct the address"
        ) from None


def _check_certificates(address: str) -> None:
    """Raise UsageError for an address with TLS without certificates, or for some that cannot be
    read.
    """
    from distributed.security import Security

    try:
        context = Security().get_connection_args("client")["ssl_context"]
    except OSError as error:
        raise UsageError(
            f"--dask {address}: the certificates that Dask is configured with cannot be read "
            f"({error.strerror or error}); correct {TLS}…"
        ) from None
    if context is None and address.startswith("tls://"):
        raise UsageError(
            f"--dask {address} needs certificates: set {TLS}CA_FILE, {TLS}CLIENT__CERT and "
            f"{TLS}CLIENT__KEY"
        )


def _check_workers(client: Client, address: str) -> None:
    """Raise UsageError for a worker that would fly otherwise than this computer, by its name."""
    try:
        client.wait_for_workers(1, timeout=FIRST_WORKER)
    except TimeoutError:
        raise LinkError(f"the scheduler {address} has no workers; start `dask worker`") from None
    ours = {"distributed": version("distributed"), **software()}
    refused = [
        line
        for worker, told in client.run(_asked()).items()
        if (line := _refusal(worker, told, ours))
    ]
    if refused:
        more = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise UsageError(refused[0] + more)


def _refusal(worker: str, told: Mapping[str, str], ours: Mapping[str, str]) -> str:
    """Return why a worker is refused, empty if it is not."""
    for name, wanted in ours.items():
        if not (found := told.get(name, "")):
            return f"the worker {worker} ({told['host']}) has no {name}; install it there"
        if found != wanted:
            return (
                f"the worker {worker} ({told['host']}) has {name} {found}, this computer has "
                f"{wanted}; install the same"
            )
    return ""


def _asked() -> Callable[[], dict[str, str]]:
    """Return a function for a worker that may lack quadlab: as a local one, it travels as code."""

    def asked() -> dict[str, str]:
        import platform
        from importlib.metadata import PackageNotFoundError, version

        told = {"host": platform.node()}
        for name in ("distributed", "quadlab"):
            try:
                told[name] = version(name)
            except PackageNotFoundError:
                told[name] = ""
        if told["quadlab"]:
            try:
                from extensions.campaigns.beginning import software
            except ImportError:  # an older one
                told["sources"] = "without campaigns"
            else:
                told |= software()
        return told

    return asked


def _by_value() -> Callable[[Task, dict[str, str], float], Answer]:
    """Return a function that flies on a worker, which may have joined after the others."""

    def flown(task: Task, wanted: dict[str, str], limit: float) -> Answer:
        from extensions.campaigns.engines.dask_worker import fly_here

        return fly_here(task, wanted, limit)

    return flown
