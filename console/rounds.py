"""Periodic tasks of the station that share a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping

Task = Callable[[], None]


def run_rounds(
    tasks: Mapping[Task, float], closing: threading.Event, guard: Callable[[Task], None]
) -> None:
    """Call each task every so many seconds until `closing`; one that takes long delays the others.

    Args:
        tasks: periods (s), by what is called.
        guard: calls a function and survives its defects.
    """
    due = {task: time.monotonic() + period for task, period in tasks.items()}
    while not closing.wait(max(0.0, min(due.values()) - time.monotonic())):
        for task, period in tasks.items():
            if time.monotonic() >= due[task]:
                guard(task)
                due[task] = time.monotonic() + period
