"""The clock that everything about a flight goes by: stamps, ages, time-outs and logs.

It is the computer's own, as `time` gives it under the same names, unless the vehicle is simulated
in lockstep: then it is the simulation's, which all processes of one `quadlab up` read out of a
page of shared memory. That one goes as the computer's does, but never past the instant up to
which the simulation has got, so it slows when the machine is starved. When the simulation has not
got on for `GONE_NS` it has died, and the clock runs on without it: time-outs still end.

Waiting is the computer's business: who sleeps until a time of this clock wakes early at worst,
and looks again.
"""

from __future__ import annotations

import mmap
import os
import time
from pathlib import Path

from quadrotor.errors import StorageError

VARIABLE = "QUADLAB_LOCKSTEP"
"""Environment variable with the page's path, for the processes of one `quadlab up`."""
GONE_NS = 5_000_000_000
"""More than a busy machine keeps a simulation waiting that lives."""
EPOCH, OFFSET, LIMIT, FACTOR, VEHICLES, STOPPING = range(6)
"""Index in 8-byte words of the page. EPOCH: the host's epoch time minus its steady clock, at the
page's making. OFFSET: of the simulation's clock before the host's steady one. LIMIT: up to where
the simulation has got. All in ns. FACTOR: simulated time over the computer's, in millionths.
STOPPING: 1 once the parts are being stopped, so that their ends are no news."""
HEADER = 8
"""Words before the vehicles' own."""
FREE = (1 << 63) - 1
"""LIMIT while no simulation holds the time."""


class _Followed:
    page: memoryview | None = None


_followed = _Followed()


def follow(path: str | Path | None) -> None:
    """Go by the page at `path` from now on; None: by the computer's clock. Raises StorageError."""
    _followed.page = None if path is None else open_page(path)


def open_page(path: str | Path) -> memoryview:
    """Open the page's 8-byte words. Raises StorageError."""
    try:
        with open(path, "r+b") as file:
            return memoryview(mmap.mmap(file.fileno(), 0)).cast("q")
    except (OSError, ValueError) as error:
        raise StorageError(
            f"the simulation's clock cannot be read from {path} ({error}); unset {VARIABLE}, "
            "which only `quadlab up` sets for its own processes"
        ) from None


def page() -> memoryview | None:
    """Return the page that is followed; None: the computer's clock."""
    return _followed.page


def monotonic_ns() -> int:
    """Return the flight's steady clock in ns, as time.monotonic_ns."""
    words = _followed.page
    if words is None:
        return time.monotonic_ns()
    # In this order: an offset that is taken back meanwhile would set the clock back, too.
    offset = words[OFFSET]
    now = offset + time.monotonic_ns()
    limit = words[LIMIT]
    return now if now <= limit else max(limit, now - GONE_NS)


def monotonic() -> float:
    """Return the flight's steady clock in s, as time.monotonic."""
    return monotonic_ns() * 1e-9


def time_ns() -> int:
    """Return the epoch time in ns, as time.time_ns; a simulation keeps its own while it lasts."""
    words = _followed.page
    return time.time_ns() if words is None else monotonic_ns() + words[EPOCH]


def wall_time() -> float:
    """Return the epoch time in s, as time.time."""
    return time_ns() * 1e-9


def real_time_factor() -> float:
    """Return simulated time over the computer's, of the last seconds; 0 without a simulation."""
    words = _followed.page
    if words is None or words[LIMIT] == FREE:
        return 0.0
    if time.monotonic_ns() + words[OFFSET] - words[LIMIT] > GONE_NS:
        return 0.0
    return words[FACTOR] * 1e-6


if VARIABLE in os.environ:
    follow(os.environ[VARIABLE])
