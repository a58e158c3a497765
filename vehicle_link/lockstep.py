"""The page of shared memory of a simulation in lockstep: its clock, and how far each part has come.

A part tells what it has dealt with; the simulator, which is the only one that lets time go on,
waits for it (`vehicle.simulator.lockstep`). Every word has one writer, and no one waits for a
lock: a part that dies leaves its words as they were.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
import time
from array import array
from collections.abc import Sequence
from pathlib import Path

from quadrotor.errors import StorageError
from vehicle_link import clock

LINES = 2
ANSWERED, TRUTH, STATION, VEHICLE = 0, LINES, LINES + 1, LINES + 2
FLIGHT_PROCESS, COMMS_PROCESS, STATION_PROCESS = LINES + 3, LINES + 4, LINES + 5
SERVED = LINES + 6
"""Index in a vehicle's words. ANSWERED, one a serial line: the microcontroller's time (ms) in the
newest sample that flight has ticked on. TRUTH: the newest truth that the station has made poses of.
STATION: when the station sent the newest heartbeat that comms heard after all poses before it.
VEHICLE: the newest sample that the station has heard of. SERVED: when flight began to look at what
it then has dealt with. These four in ns of `clock.monotonic_ns`. …_PROCESS: ids."""
WORDS, NAME = 9, 32
"""Words of each vehicle, and bytes of its name behind the words of all."""
PREFIX = "quadlab-clock-"
SHARED_MEMORY = Path("/dev/shm")


class Page:
    """A new page, for one `quadlab up`; removed by `close`.

    Args:
        names: of the vehicles.
        folder: for it, where there is no shared memory.
        port: of the station's session on loopback, by which `page_at` finds it.

    Attributes:
        path: for `clock.VARIABLE`.

    Raises StorageError when it cannot be made.
    """

    def __init__(self, names: Sequence[str], folder: Path, port: int = 0) -> None:
        # Not on a disk where it can be helped: writing pages back may make their writer wait.
        place = SHARED_MEMORY if os.access(SHARED_MEMORY, os.W_OK) else folder
        header = array("q", [0] * (clock.HEADER + WORDS * len(names)))
        header[clock.EPOCH] = time.time_ns() - time.monotonic_ns()
        header[clock.LIMIT], header[clock.FACTOR] = clock.FREE, 1_000_000
        header[clock.VEHICLES] = len(names)
        content = header.tobytes()
        content += b"".join(name.encode().ljust(NAME, b"\0") for name in names)
        try:
            descriptor, path = tempfile.mkstemp(prefix=f"{PREFIX}{port}-", dir=place)
            self._file = os.fdopen(descriptor, "wb")
            self._file.write(content)
            self._file.flush()
            fcntl.flock(self._file, fcntl.LOCK_EX)  # as long as this process lives
        except OSError as error:
            raise StorageError(
                f"cannot make the simulation's clock in {place}: {error.strerror}; make room "
                "there, or fly with --real-time"
            ) from None
        self.path = Path(path)

    def close(self) -> None:
        self.path.unlink(missing_ok=True)
        self._file.close()


def page_at(port: int) -> Path | None:
    """Return the page of the simulation whose station serves this port on loopback, None where
    there is none: that station goes by the computer's clock.
    """
    for path in SHARED_MEMORY.glob(f"{PREFIX}{port}-*"):
        try:
            with path.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)  # whose owner was killed
        except BlockingIOError:
            return path
        except OSError:  # gone meanwhile, or somebody else's
            continue
    return None


class Part:
    """The progress of one process with one vehicle, for the simulator; without lockstep it is not
    looked at.

    Attributes:
        in_lockstep: whether someone does.
    """

    def __init__(self, name: str) -> None:
        words = clock.page()
        found = None if words is None else words_of(words, name)
        self.in_lockstep = found is not None
        self._words = memoryview(bytearray(8 * WORDS)).cast("q") if found is None else found
        self._epoch_ns = 0 if words is None else words[clock.EPOCH]

    def is_this_process(self, at: int) -> None:
        """Name this process as the one of `at`, one of the words …_PROCESS: it may die."""
        self._words[at] = os.getpid()

    def answered(self, line: int, milliseconds: int) -> None:
        """Note that flight has ticked on the sample of this time of the microcontroller, from this
        line.
        """
        self._words[ANSWERED + line] = milliseconds

    def served(self, began_ns: int) -> None:
        """Note that flight has taken all that had come at this time of the steady clock, and has
        asked for what was due.
        """
        self._words[SERVED] = began_ns

    def truth(self, stamp_ns: int) -> None:
        """Note that the station has sent what follows from the truth of this stamp (epoch)."""
        self._words[TRUTH] = stamp_ns - self._epoch_ns

    def station_heard(self, stamp_ns: int) -> None:
        """Note that comms has passed on what the station sent until then (epoch)."""
        self._words[STATION] = stamp_ns - self._epoch_ns

    def vehicle_heard(self, stamp_ns: int) -> None:
        """Note that the station has received the vehicle's sample of then (epoch)."""
        self._words[VEHICLE] = stamp_ns - self._epoch_ns


def words_of(page: memoryview, name: str) -> memoryview | None:
    """Return a vehicle's words; None when the page has no such vehicle."""
    count = page[clock.VEHICLES]
    names = clock.HEADER + WORDS * count
    for number in range(count):
        at = 8 * names + NAME * number
        if bytes(page.cast("B")[at : at + NAME]).rstrip(b"\0").decode() == name:
            first = clock.HEADER + WORDS * number
            return page[first : first + WORDS]
    return None
