"""The shared memory page of a simulation in lockstep: its clock, and the progress of each process.

Each process reports what it has handled; the simulator, which alone advances the time, waits for
it (`vehicle.simulator.lockstep`). Every word has one writer and there are no locks: the words of a
process that dies stay as they were.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from quadrotor.errors import StorageError
from vehicle_link import clock

LINES = 2
ANSWERED, TRUTH, STATION, VEHICLE = 0, LINES, LINES + 1, LINES + 2
FLIGHT_PROCESS, COMMS_PROCESS, STATION_PROCESS = LINES + 3, LINES + 4, LINES + 5
SERVED = LINES + 6
"""Indices of a vehicle's words. ANSWERED, one for each serial line: the microcontroller's time (ms)
in the newest sample for which flight has run a tick. TRUTH: the newest truth from which the
station has made poses. STATION: when the station sent the newest heartbeat that comms received
after all poses before it. VEHICLE: the newest sample that the station has received. SERVED: when
flight began the pass in which it handled all that had arrived. These four are in ns of
`clock.monotonic_ns`. …_PROCESS: process ids."""
WORDS, NAME = 9, 32
"""Number of words of each vehicle, and bytes of its name; the names follow all words."""
PREFIX = "quadlab-clock-"
SHARED_MEMORY = Path("/dev/shm")


class Page:
    """A new page for one `quadlab up`; `close` removes it.

    Args:
        names: of the vehicles.
        folder: where the page is made if there is no shared memory.
        port: loopback port of the station's session, by which `page_at` finds the page.

    Attributes:
        path: value for `clock.VARIABLE`.

    Raises StorageError when it cannot be made.
    """

    def __init__(self, names: Sequence[str], folder: Path, port: int = 0) -> None:
        # Avoid a disk if possible: writing pages back may block the process that writes them.
        place = SHARED_MEMORY if os.access(SHARED_MEMORY, os.W_OK) else folder
        header = array("q", [0] * (clock.HEADER + WORDS * len(names)))
        header[clock.EPOCH] = clock.host_time_ns() - time.monotonic_ns()
        header[clock.LIMIT], header[clock.FACTOR] = clock.FREE, 1_000_000
        header[clock.VEHICLES] = len(names)
        content = header.tobytes()
        content += b"".join(name.encode().ljust(NAME, b"\0") for name in names)
        _remove_leftovers(place)
        try:
            descriptor, path = tempfile.mkstemp(prefix=f".{PREFIX}{port}-", dir=place)
            self._file = os.fdopen(descriptor, "wb")
            self._file.write(content)
            self._file.flush()
            fcntl.flock(self._file, fcntl.LOCK_EX)  # held as long as this process lives
            # Nobody finds the page under its name before it is locked.
            self.path = Path(path).with_name(Path(path).name.removeprefix("."))
            os.rename(path, self.path)
        except OSError as error:
            raise StorageError(
                f"cannot make the simulation's clock in {place}: {error.strerror}; make room "
                "there, or fly with --real-time"
            ) from None

    def close(self) -> None:
        self.path.unlink(missing_ok=True)
        self._file.close()


def _remove_leftovers(place: Path) -> None:
    """Remove the pages of this user whose owners were killed: nobody holds their locks."""
    for path in place.glob(f"{PREFIX}*"):
        try:
            if path.lstat().st_uid != os.getuid():
                continue
            with path.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()
        except OSError:  # its owner lives (BlockingIOError), or it was removed in the meantime
            continue


@contextmanager
def one_clock(names: Sequence[str], folder: Path, port: int) -> Iterator[None]:
    """Provide one clock, of a new `Page`, for this process and all child processes."""
    page = Page(names, folder, port)
    os.environ[clock.VARIABLE] = str(page.path)
    try:
        clock.follow(page.path)
        yield
    finally:
        clock.follow(None)
        del os.environ[clock.VARIABLE]
        page.close()


def page_at(port: int, say: Callable[[str], None] = lambda line: None) -> Path | None:
    """Return the page of the simulation whose station serves this loopback port; None when that
    station follows the computer's clock.

    Args:
        say: is told of a page that is passed over, because it is another user's.
    """
    for path in SHARED_MEMORY.glob(f"{PREFIX}{port}-*"):
        try:
            with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC), "rb") as file:
                if not clock.is_own(file.fileno()):
                    say(f"{path} is another user's; its clock is not followed")
                    continue
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # works if its owner was killed
        except BlockingIOError:
            return path
        except OSError:  # removed in the meantime, or of another user
            continue
    return None


class ProcessProgress:
    """The progress of one process with one vehicle, for the simulator; unused without lockstep.

    Attributes:
        in_lockstep: whether a simulator waits for this process.
    """

    def __init__(self, name: str) -> None:
        words = clock.page()
        found = None if words is None else words_of(words, name)
        self.in_lockstep = found is not None
        self._words = memoryview(bytearray(8 * WORDS)).cast("q") if found is None else found
        self._epoch_ns = 0 if words is None else words[clock.EPOCH]

    def is_this_process(self, at: int) -> None:
        """Store this process's id in `at`, a word …_PROCESS, so that its death is noticed."""
        self._words[at] = os.getpid()

    def answered(self, line: int, milliseconds: int) -> None:
        """Note that flight has run a tick on the sample with this microcontroller time from this
        line.
        """
        self._words[ANSWERED + line] = milliseconds

    def served(self, began_ns: int) -> None:
        """Note that flight has handled everything that had arrived at this time of the steady
        clock, and has sent the requests that were due.
        """
        self._words[SERVED] = began_ns

    def truth(self, stamp_ns: int) -> None:
        """Note that the station has sent everything derived from the truth of this stamp
        (epoch).
        """
        self._words[TRUTH] = stamp_ns - self._epoch_ns

    def station_received(self, stamp_ns: int) -> None:
        """Note that comms has passed on all that the station sent up to this time (epoch)."""
        self._words[STATION] = stamp_ns - self._epoch_ns

    def vehicle_received(self, stamp_ns: int) -> None:
        """Note that the station has received the vehicle's sample of this time (epoch)."""
        self._words[VEHICLE] = stamp_ns - self._epoch_ns


def words_of(page: memoryview, name: str) -> memoryview | None:
    """Return the words of a vehicle; None when the page has no such vehicle."""
    count = page[clock.VEHICLES]
    names = clock.HEADER + WORDS * count
    for number in range(count):
        at = 8 * names + NAME * number
        if bytes(page.cast("B")[at : at + NAME]).rstrip(b"\0").decode() == name:
            first = clock.HEADER + WORDS * number
            return page[first : first + WORDS]
    return None
