"""A benchmark that is stopped leaves no process."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

FLYING = """
import os, signal, sys, time
from benchmarks.flights import failing_flights

def fly():
    print(os.getpid(), flush=True)
    time.sleep(600.0)

signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
failing_flights._tasks = lambda *_: [([("station", "lap", 1)], fly)] * 3
failing_flights.fly_all(1, (), (), {}, minutes=10.0)
"""


def test_flights_end_at_once_with_the_benchmark_that_flies_them() -> None:
    started = subprocess.Popen([sys.executable, "-c", FLYING], stdout=subprocess.PIPE, text=True)
    assert started.stdout is not None
    worker = int(started.stdout.readline())
    started.terminate()
    assert started.wait(60.0) == 1
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)
    started.stdout.close()
