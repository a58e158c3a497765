"""The clock for everything about a flight: stamps, ages, time-outs and logs.

It is the computer's steady clock, counted from an epoch that is read once, when the first process
starts, and handed on to the processes that it starts: setting the computer's clock, by seconds or
by years, moves no stamp (`SetClock` reports it). Where the vehicle is simulated in lockstep, it is
the simulation's clock, which all processes of one `quadlab up` read from a page of shared memory.
The simulation's clock runs at the computer's rate but never past the
instant that the simulation has reached, so it slows down when the machine is overloaded. When the
simulation has not advanced for `DEAD_AFTER_NS` it counts as dead, and the clock runs on without it,
so that time-outs still end.

Waiting uses the computer's clock: a caller that sleeps until a time of this clock wakes early at
worst, and checks again.
"""

from __future__ import annotations

import mmap
import os
import stat
import time
from pathlib import Path

from quadrotor.errors import StorageError

VARIABLE = "QUADLAB_LOCKSTEP"
"""Environment variable with the page's path, for the processes of one `quadlab up`."""
EPOCH_VARIABLE = "QUADLAB_EPOCH"
"""Environment variable with the epoch time at which the steady clock was 0, in ns, for processes
that this one starts."""
DEAD_AFTER_NS = 5_000_000_000
"""Nanoseconds without progress after which a simulation counts as dead: longer than a busy machine
delays a live one."""
EPOCH, OFFSET, LIMIT, FACTOR, VEHICLES, STOPPING = range(6)
"""Indices of the page's 8-byte words. EPOCH: the host's epoch time minus its steady clock, when
the page was made. OFFSET: the simulation's clock minus the host's steady clock. LIMIT: the time
that the simulation has reached. All in ns. FACTOR: simulated time over the computer's, in
millionths. STOPPING: 1 once the processes are being stopped, so that their ends are expected."""
HEADER = 8
"""Number of words before those of the vehicles."""
FREE = (1 << 63) - 1
"""Value of LIMIT while no simulation controls the time."""


_STEADY = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""The steady clock that goes on while the computer sleeps, where there is such a clock."""


def _epoch_ns() -> int:
    """Return the epoch that was handed on, else the one that this process hands on from now on."""
    own = time.time_ns() - time.clock_gettime_ns(_STEADY)
    return int(os.environ.setdefault(EPOCH_VARIABLE, str(own)))


_EPOCH_NS = _epoch_ns()


class _Followed:
    page: memoryview | None = None


_followed = _Followed()


def follow(path: str | Path | None) -> None:
    """Follow the page at `path` from now on; None: the computer's clock. Raises StorageError."""
    _followed.page = None if path is None else open_page(path)


def open_page(path: str | Path) -> memoryview:
    """Open the page's 8-byte words. Raises StorageError, also for a page that others can write."""
    try:
        # No link: anybody can put one into the shared folder.
        with open(os.open(path, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC), "r+b") as file:
            if not is_own(file.fileno()):
                raise ValueError("it is another user's, or others may write it")
            return memoryview(mmap.mmap(file.fileno(), 0)).cast("q")
    except (OSError, ValueError) as error:
        raise StorageError(
            f"the simulation's clock cannot be read from {path} ({error}); unset {VARIABLE}, "
            "which only `quadlab up` sets for its own processes"
        ) from None


def is_own(descriptor: int) -> bool:
    """Return whether an open file is one of this user that no other user may write."""
    found = os.fstat(descriptor)
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def page() -> memoryview | None:
    """Return the page that is followed; None for the computer's clock."""
    return _followed.page


def monotonic_ns() -> int:
    """Return the flight's steady clock in ns, as time.monotonic_ns."""
    words = _followed.page
    if words is None:
        return time.monotonic_ns()
    # Read in this order: if OFFSET is reduced in between, the clock would otherwise go back.
    offset = words[OFFSET]
    now = offset + time.monotonic_ns()
    limit = words[LIMIT]
    return now if now <= limit else max(limit, now - DEAD_AFTER_NS)


def monotonic() -> float:
    """Return the flight's steady clock in s, as time.monotonic."""
    return monotonic_ns() * 1e-9


def host_time_ns() -> int:
    """Return the computer's epoch time in ns, whatever its clock was set to since the start."""
    return _EPOCH_NS + time.clock_gettime_ns(_STEADY)


def time_ns() -> int:
    """Return the epoch time in ns, as `host_time_ns`; under lockstep it follows simulated time."""
    words = _followed.page
    return host_time_ns() if words is None else monotonic_ns() + words[EPOCH]


def wall_time() -> float:
    """Return the computer's epoch time in s, for lists that people read; stamps use `time_ns`."""
    return host_time_ns() * 1e-9


def has_begun() -> bool:
    """Return whether the simulation, if any, has begun: on its first start it compiles before."""
    return _followed.page is None or _followed.page[LIMIT] != FREE


def real_time_factor() -> float:
    """Return simulated time over real time in the last seconds; 0 without a simulation."""
    words = _followed.page
    if words is None or not has_begun():
        return 0.0
    if time.monotonic_ns() + words[OFFSET] - words[LIMIT] > DEAD_AFTER_NS:
        return 0.0
    return words[FACTOR] * 1e-6


if VARIABLE in os.environ:
    follow(os.environ[VARIABLE])
