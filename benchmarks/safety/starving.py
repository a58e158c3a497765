"""The faults of processes, resources and clocks that a running laboratory is given."""

from __future__ import annotations

import os
import resource
import signal
import socket
import struct
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from benchmarks.safety.laboratory import Laboratory

PARTS = {
    "flight": "vehicle.flight.process",
    "comms": "vehicle.comms.process",
    "vehicle": "quadlab vehicle",
    "station": "quadlab station",
    "web": "quadlab web",
    "simulator": "quadlab simulator",
    "up": "quadlab up",
}
"""Words in the command line of each process."""
MEMORY = 1 << 20
"""Address space, in bytes, of a process without memory: less than it has, so that it gets none."""
FROZEN = 5.0
"""Time, in s, for which a process is frozen."""
DOWN = 8.0
"""Time, in s, for which the link is down."""
HOUR, FORTY_DAYS = 3600, 40 * 86400
FILLER = "filler"
Begin = Callable[["Place", ExitStack], None]


@dataclass
class Place:
    """A laboratory with a data folder and a /dev/shm of its own, and a clock that can be set.

    Attributes:
        folder, shared: the folders, as this process sees them.
        clock: file with the seconds by which the clock is off.
    """

    lab: Laboratory
    folder: Path
    shared: Path
    clock: Path

    def pids(self, part: str = "") -> list[int]:
        """Return the processes of a part, or of all."""
        found = []
        for pid in family(self.lab.up.pid):
            words = command_line(pid)
            if PARTS.get(part, "") in words and words:
                found.append(pid)
        return found

    def set_clock(self, seconds: int) -> None:
        """Put the clock off by this much."""
        write_step(self.clock, seconds)


def write_step(file: Path, seconds: int) -> None:
    """Write the seconds by which a clock is off, in place: the file is mapped."""
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT, 0o600)
    try:
        os.pwrite(descriptor, struct.pack("=q", seconds), 0)
    finally:
        os.close(descriptor)


def command_line(pid: int) -> str:
    """Return the words of a process, "" if it has ended."""
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    except (OSError, UnicodeDecodeError):
        return ""


def family(parent: int) -> set[int]:
    """Return a process and all its descendants."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            fields = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            parents[int(entry.name)] = int(fields[1])
    found = {parent}
    while more := {pid for pid, of in parents.items() if of in found} - found:
        found |= more
    return found


def killed(part: str) -> Begin:
    """Return the fault of a process that is killed."""

    def begin(place: Place, _: ExitStack) -> None:
        for pid in place.pids(part):
            os.kill(pid, signal.SIGKILL)

    return begin


def frozen(part: str) -> Begin:
    """Return the fault of a process that gets no time until the fault ends."""

    def begin(place: Place, end: ExitStack) -> None:
        for pid in place.pids(part):
            os.kill(pid, signal.SIGSTOP)
            end.callback(_go_on, pid)

    return begin


def _go_on(pid: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGCONT)


def no_memory(part: str) -> Begin:
    """Return the fault of a process, or all, that get no memory."""
    return _limited(part, resource.RLIMIT_AS, lambda _: MEMORY)


def no_descriptors(part: str) -> Begin:
    """Return the fault of a process, or all, that can open no file."""
    return _limited(part, resource.RLIMIT_NOFILE, _first_free)


def _first_free(pid: int) -> int:
    used = {int(name) for name in os.listdir(f"/proc/{pid}/fd")}
    return next(number for number in range(len(used) + 1) if number not in used)


def _limited(part: str, which: int, limit: Callable[[int], int]) -> Begin:
    def begin(place: Place, end: ExitStack) -> None:
        for pid in place.pids(part):
            with suppress(ProcessLookupError, FileNotFoundError):
                before = resource.prlimit(pid, which)
                resource.prlimit(pid, which, (limit(pid), before[1]))
                end.callback(_limit_again, pid, which, before)

    return begin


def _limit_again(pid: int, which: int, before: tuple[int, int]) -> None:
    with suppress(ProcessLookupError):
        resource.prlimit(pid, which, before)


def full(of: Callable[[Place], Path]) -> Begin:
    """Return the fault of a folder that takes nothing more."""

    def begin(place: Place, end: ExitStack) -> None:
        filler = of(place) / FILLER
        end.callback(filler.unlink)
        with filler.open("wb", buffering=0) as file, suppress(OSError):
            while True:
                file.write(bytes(1 << 16))

    return begin


def clock_set(seconds: int) -> Begin:
    """Return the fault of a computer whose clock is set by so many seconds, and back later."""

    def begin(place: Place, end: ExitStack) -> None:
        place.set_clock(seconds)
        end.callback(place.set_clock, 0)

    return begin


STARVED = [part for part in PARTS if part != "simulator"]


def link_down(_: Place, end: ExitStack) -> None:
    """Take the loopback device of this network namespace down for a while."""
    _loopback("down")
    back = threading.Timer(DOWN, _loopback, ["up"])
    back.start()
    end.callback(back.join)


def _loopback(state: str) -> None:
    subprocess.run(["ip", "link", "set", "lo", state], check=True)


def has_own_network() -> bool:
    """Return whether this network namespace has the loopback device alone: no other program's."""
    return [name for _, name in socket.if_nameindex()] == ["lo"]


FAULTS: dict[str, Begin] = {
    **{f"{part} killed": killed(part) for part in PARTS},
    **{f"{part} frozen": frozen(part) for part in PARTS},
    **{f"{part} without memory": no_memory(part) for part in STARVED},
    **{
        f"{part} without descriptors": no_descriptors(part) for part in PARTS if part != "simulator"
    },
    "all without memory": no_memory(""),
    "all without descriptors": no_descriptors(""),
    "disk full": full(lambda place: place.folder),
    "/dev/shm full": full(lambda place: place.shared),
    "clock + 1 h": clock_set(HOUR),
    "clock - 1 h": clock_set(-HOUR),
    "clock + 40 d": clock_set(FORTY_DAYS),
    "clock - 40 d": clock_set(-FORTY_DAYS),
    **({"link down": link_down} if has_own_network() else {}),
}
"""The action of each fault, by its name."""


@contextmanager
def fault(name: str, place: Place) -> Iterator[None]:
    """Have a fault within the block."""
    with ExitStack() as end:
        FAULTS[name](place, end)
        yield
