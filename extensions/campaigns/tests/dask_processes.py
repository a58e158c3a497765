"""Schedulers and workers of Dask in processes of their own, on this computer."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

SCHEDULER = ("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show")
START = 200.0
"""s within which a process of Dask starts on a busy computer."""


@contextmanager
def dask(
    *words: str, until: str, python: tuple[str, ...] = (), environment: dict[str, str] | None = None
) -> Iterator[Any]:
    """Run a process of Dask until the end of the block; yield it, and the line with which it has
    started.
    """
    command = [*(python or (sys.executable,)), "-m", f"distributed.cli.dask_{words[0]}", *words[1:]]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, env=os.environ | (environment or {})
    )
    assert process.stderr is not None
    late = threading.Timer(START, process.kill)
    late.start()
    said = []
    for line in process.stderr:
        said.append(line)
        if until in line:
            break
    else:
        raise AssertionError(f"{command} has not started: {''.join(said)}")
    late.cancel()
    drain = threading.Thread(target=process.stderr.read, daemon=True)
    drain.start()
    try:
        yield process, line
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait()
        drain.join()
        process.stderr.close()


def worker(scheduler: str, *words: str, **more: Any) -> Any:
    """Return a context with a worker that has one thread."""
    given = ("worker", scheduler, "--nthreads", "1", "--no-dashboard", *words)
    return dask(*given, until="Registered to:", **more)
