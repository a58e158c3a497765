"""Flights in a worker of Dask: one after the other, as a flight has its process to itself."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping

from extensions.campaigns.beginning import software
from extensions.campaigns.flights import Outcome, Task, fly_task

ONE_FLIGHT = threading.Lock()


def fly_here(task: Task, wanted: Mapping[str, str], limit: float) -> tuple[str, list[Outcome]]:
    """Return why this worker is refused, empty if it is not, and the outcomes.

    A flight that lasts longer than the limit (s) ends the worker, as nothing else ends it.
    """
    from distributed import get_worker

    ours = software()
    differing = [name for name in wanted if ours.get(name) != wanted[name]]
    if differing:
        name = differing[0]
        line = f"the worker {get_worker().address} has {name} {ours.get(name)}, not {wanted[name]}"
        return f"{line}; install the same", []
    with ONE_FLIGHT:
        end = threading.Timer(limit * len(task.indices), os._exit, (1,))
        end.daemon = True
        end.start()
        try:
            return "", fly_task(task)
        finally:
            end.cancel()
