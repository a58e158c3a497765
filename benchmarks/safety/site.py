"""Laboratories on small file systems of their own, with a clock that can be set."""

from __future__ import annotations

import os
import subprocess
import time
from contextlib import ExitStack
from pathlib import Path

from benchmarks.safety.laboratory import LOOK, Laboratory
from benchmarks.safety.starving import Place, command_line, write_step
from quadrotor.errors import QuadlabError

DISK, SHARED = "2g", "64m"
"""Sizes of the file systems."""
BEHIND = (
    'mount -t tmpfs -o size={} none "$0" && mount -t tmpfs -o size={} none /dev/shm && exec "$@"'
)


class Site:
    """Laboratories one after another in one data folder: a new one when the last has ended."""

    def __init__(self, folder: Path, boot_step: int = 0) -> None:
        self._folder = folder
        self._place: Place | None = None
        self._clock = folder / "clock"
        self._library = compile_clock(folder)
        self._boot_step = boot_step
        self._kept = ExitStack()
        self.orphans: list[str] = []

    def place(self) -> Place:
        """Return the running laboratory, with the vehicle ready. Raises QuadlabError."""
        if self._place is not None and self._place.lab.up.poll() is not None:
            self.close()
        if self._place is None:
            self._place = self._begin()
        return self._place

    def _begin(self) -> Place:
        data = self._folder / f"data{time.monotonic_ns()}"
        data.mkdir()
        write_step(self._clock, self._boot_step)
        before = [
            *("unshare", "--mount", "--map-root-user", "sh", "-c", BEHIND.format(DISK, SHARED)),
            *(str(data), "env", f"LD_PRELOAD={self._library}", f"CLOCK_STEP={self._clock}"),
        ]
        lab = Laboratory(data, before=before)
        root = Path(f"/proc/{lab.up.pid}/root")
        # The file systems end with their last user: the logs of a laboratory that died stay here.
        kept, shared = self._held(root / str(data)[1:]), self._held(root / "dev/shm")
        return Place(lab, kept, shared, self._clock)

    def _held(self, folder: Path) -> Path:
        """Return a folder by a descriptor that is open until the end."""
        descriptor = os.open(folder, os.O_RDONLY)
        self._kept.callback(os.close, descriptor)
        return Path(f"/proc/self/fd/{descriptor}")

    def close(self) -> None:
        """End the laboratory, and note what outlives it."""
        place, self._place = self._place, None
        if place is None:
            return
        with ExitStack() as stack:
            stack.callback(self._kept.close)
            stack.callback(self._note_orphans, place.lab.data)
            try:
                place.lab.close()
            except QuadlabError as error:
                self.orphans.append(str(error))

    def _note_orphans(self, data: Path) -> None:
        end = time.monotonic() + 15.0
        while (left := orphans(data)) and time.monotonic() < end:
            time.sleep(LOOK)
        self.orphans += left


def compile_clock(folder: Path) -> Path:
    """Compile the library by which a clock is set. Raises CalledProcessError."""
    library, source = folder / "clock_step.so", Path(__file__).with_name("clock_step.c")
    subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", library, source, "-ldl"], check=True)
    return library


def orphans(data: Path) -> list[str]:
    """Return the processes that still have this data folder in their words."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        words = command_line(int(entry.name))
        if str(data) in words and int(entry.name) != os.getpid():
            found.append(words[:80])
    return found
