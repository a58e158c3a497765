"""Start the two ends of `python -m benchmarks link` and collect their notes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import numpy as np

from benchmarks.impairment.link import A, B, ImpairedLink
from benchmarks.link.ends import Plan
from benchmarks.link.notes import Found
from quadrotor.checkout import ROOT
from quadrotor.errors import QuadlabError
from vehicle_link.security.authority import ensure_certificates

SETTLED = 2.0
"""Time, in s, at the start that does not count: the lane starts, the clock is synchronised."""
PATIENCE = 20.0


class Running:
    """Both ends running, over a link without faults until its conditions change."""

    def __init__(self, link: ImpairedLink, folder: Path, plan: Plan) -> None:
        self.link, self._folder = link, folder
        words = [sys.executable, "-m", "benchmarks.link.ends"]
        more = {"cwd": ROOT, "stdout": subprocess.PIPE}
        wanted = msgspec.json.encode(plan).decode()
        self._programs = []
        for end, name in ((A, "vehicle"), (B, "station")):
            program = link.run(end, [*words, name, str(folder), wanted], **more)
            self._programs.append(program)
            _hear(program, b"up\n")
        time.sleep(SETTLED)

    def memory(self) -> tuple[float, float]:
        """Return the resident memory (MB) of vehicle and station."""
        pages = [int(Path(f"/proc/{p.pid}/statm").read_text().split()[1]) for p in self._programs]
        size = os.sysconf("SC_PAGE_SIZE") / 1e6
        return pages[0] * size, pages[1] * size

    def start_download(self) -> None:
        self._programs[1].send_signal(signal.SIGUSR1)

    def finish(self) -> Found:
        """End both and return their notes."""
        notes = {}
        for program, name in zip(reversed(self._programs), ("station", "vehicle"), strict=True):
            program.terminate()
            _hear(program, b"written\n")
            with np.load(self._folder / f"{name}.npz") as file:
                notes.update({key: file[key] for key in file.files})
        if not len(notes["telemetry"]):
            raise QuadlabError("no telemetry came over the link")
        return Found(**notes)


@contextmanager
def running(plan: Plan, seed: int = 11) -> Iterator[Running]:
    """Run both ends over an impaired link.

    Raises StorageError where namespaces are not allowed, QuadlabError when an end fails.
    """
    with tempfile.TemporaryDirectory() as name, ImpairedLink(seed) as link:
        ensure_certificates(Path(name), [A])
        yield Running(link, Path(name), plan)


def _hear(program: subprocess.Popen[bytes], line: bytes) -> None:
    assert program.stdout is not None
    if program.stdout.readline() != line:
        raise QuadlabError("an end of the link has failed; see its lines above")
