"""The vehicle's own logs as files: their list and their bytes.

Services `onboard_files` and `onboard_part`, with answers of a few kilobytes, as flight data has
priority. A request at background priority is answered at that priority.
"""

from __future__ import annotations

import hashlib
import os
import stat
import threading
import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flight_log.index import begins_as_log, is_closed, read_index
from quadrotor.errors import LogFormatError, QuadlabError, RefusedError, StorageError, os_errors
from vehicle.onboard_log.file import Written
from vehicle.onboard_log.file_identity import identity_of
from vehicle.onboard_log.repair import LATER
from vehicle.onboard_log.ring import Fetched, free_bytes
from vehicle_link.messages import Message, new
from vehicle_link.messages.records import OnboardFilesRequest, OnboardPartRequest
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import prepare
from vehicle_link.transport.node import Node

PIECE_BYTES = 1_000_000
KEPT = 32
NICE = 10

Key = tuple[str, int, int]
"""Name, identity, size."""


class Checksums:
    def __init__(self) -> None:
        self._found: OrderedDict[Key, bytes] = OrderedDict()
        self._pending: set[Key] = set()
        self._wanted: SimpleQueue[tuple[Key, Path]] = SimpleQueue()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def ask(self, path: Path, identity: int, size: int) -> bytes:
        """Return the checksum (32 bytes), or no bytes while it is being computed."""
        key = path.name, identity, size
        with self._lock:
            if key in self._found:
                self._found.move_to_end(key)
                return self._found[key]
            if key not in self._pending:
                self._pending.add(key)
                self._wanted.put((key, path))
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="checksums", daemon=True)
                self._thread.start()
        return b""

    def _run(self) -> None:
        with suppress(OSError):  # Linux sets the priority of this thread alone
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), NICE)
        while True:
            key, path = self._wanted.get()
            try:
                digest = _sha256(path)
            except OSError:  # removed, which the next request reports
                digest = b""
            with self._lock:
                self._pending.discard(key)
                if digest:
                    self._found[key] = digest
                if len(self._found) > KEPT:
                    self._found.popitem(last=False)


def _sha256(path: Path) -> bytes:
    made = hashlib.sha256()
    with path.open("rb", buffering=0) as stream:
        while piece := stream.read(PIECE_BYTES):
            made.update(piece)  # releases the interpreter lock
    return made.digest()


PART_BYTES = 2800
"""Largest number of bytes of a file in one answer: two packets on the radio."""
FILES_MAX = 100
"""Largest number of files in an answer, the newest ones: 10 kB."""
FACTS_KEPT = 1000


class Facts(NamedTuple):
    """One file as it is now; the times of a torn one are unknown."""

    name: str
    identity: int
    size: int
    start_ns: int = 0
    end_ns: int = 0
    closed: bool = False
    recovered: bool = False

    def message(self) -> Message:
        return new("quadlab_msgs/OnboardFile", **self._asdict())


class OnboardFiles:
    """Services for the logs in a folder.

    Args:
        written: returns the files of this process (`OnboardLog.files`).
        repair: returns when a torn file is repaired (`LogRepair.state`).
    """

    def __init__(
        self,
        folder: Path,
        written: Callable[[], list[Written]],
        fetched: Fetched | None = None,
        free: Callable[[Path], int] = free_bytes,
        repair: Callable[[], str] = lambda: LATER,
    ) -> None:
        self._folder, self._written, self._free = folder, written, free
        self._repair = repair
        self._fetched = fetched or Fetched()
        self._checksums = Checksums()
        self._closed: OrderedDict[Key, Facts] = OrderedDict()

    def serve(self, node: Node) -> None:
        for service, answer in (("onboard_files", self.files), ("onboard_part", self.part)):
            prepare(SERVICES[service])
            node.serve(service, SERVICES[service], answer)

    def files(self, request: OnboardFilesRequest) -> Message:
        """Answer with the list of logs. Raises StorageError."""
        found = [facts.message() for facts in self._newest()]
        return new(
            f"{SERVICES['onboard_files']}_Response",
            accepted=True,
            files=found,
            free_bytes=self._free_bytes(),
        )

    def part(self, request: OnboardPartRequest) -> Message:
        """Answer with a part of a log. Raises RefusedError or StorageError."""
        name, offset, length = str(request.name), int(request.offset), int(request.length)
        if length > PART_BYTES:
            raise RefusedError(f"{length} bytes at once are too many; allowed are {PART_BYTES}")
        with self._open(name) as file:
            facts = self._facts(name, file)
            self._fetched.note(name)
            if length == 0:
                return self._checksum(facts)
            if offset > facts.size:
                raise RefusedError(f"{name} has {facts.size} bytes, none from {offset} on")
            data = os.pread(file, min(length, facts.size - offset), offset)
        return new(
            f"{SERVICES['onboard_part']}_Response",
            accepted=True,
            file=facts.message(),
            data=_octets(data),
            crc32=zlib.crc32(data),
        )

    # ------------------------------------------------------------------ files
    def _newest(self) -> list[Facts]:
        """Return the files, newest first."""
        found = []
        for name in _names(self._folder)[:FILES_MAX]:
            try:
                with self._open(name) as file:
                    found.append(self._facts(name, file))
            except QuadlabError:  # repaired or removed in the meantime, or not a log
                continue
        return found

    @contextmanager
    def _open(self, name: str) -> Iterator[int]:
        """Open a log. Raises RefusedError when no such log is in the folder."""
        try:
            if Path(name).name != name or not name.endswith(".mcap"):
                raise FileNotFoundError
            file = os.open(self._folder / name, os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW)
        except (OSError, ValueError):
            raise RefusedError(
                f"there is no onboard log {name!r:.100}; it may have been removed to make room"
            ) from None
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise RefusedError(f"{name} is not a file")
            yield file
        except OSError as error:
            raise StorageError(f"cannot read {name}: {error.strerror}") from error
        finally:
            os.close(file)

    def _facts(self, name: str, file: int) -> Facts:
        identity, size = identity_of(file), os.fstat(file).st_size
        written = self._written_as(name)
        if written is not None and not written.closed:
            return Facts(name, identity, size, written.start_ns, written.end_ns)
        key = name, identity, size
        facts = self._closed.get(key)
        if facts is None:
            facts = Facts(*key)
            if is_closed(self._folder / name):
                index = read_index(self._folder / name)
                facts = Facts(*key, index.start_ns, index.end_ns, True, index.recovered)
                self._closed[key] = facts
                if len(self._closed) > FACTS_KEPT:
                    self._closed.popitem(last=False)
            elif not begins_as_log(file):
                raise LogFormatError(f"{name} is not an MCAP log")
        return facts

    def _written_as(self, name: str) -> Written | None:
        return next((one for one in self._written() if one.path.name == name), None)

    def _checksum(self, facts: Facts) -> Message:
        self._refuse_torn(facts)
        if not facts.closed:
            raise RefusedError(f"{facts.name} is still being written; its checksum comes after")
        digest = self._checksums.ask(self._folder / facts.name, facts.identity, facts.size)
        return new(
            f"{SERVICES['onboard_part']}_Response",
            accepted=True,
            file=facts.message(),
            sha256=_octets(digest),
        )

    def _refuse_torn(self, facts: Facts) -> None:
        """Raise RefusedError for a torn log, as its bytes change when it is repaired."""
        if not facts.closed and not facts.start_ns:
            raise RefusedError(f"{facts.name} was torn, and {self._repair()}; ask again later")

    def _free_bytes(self) -> int:
        with os_errors(lambda why: f"cannot use {self._folder}: {why}"):
            return self._free(self._folder if self._folder.exists() else self._folder.parent)


def _names(folder: Path) -> list[str]:
    """Return the names, newest first. Raises StorageError."""
    found: list[tuple[int, str]] = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.name.endswith(".mcap"):
                    with suppress(FileNotFoundError):  # just repaired or removed
                        found.append((entry.stat(follow_symlinks=False).st_mtime_ns, entry.name))
    except FileNotFoundError:
        return []
    except OSError as error:
        raise StorageError(f"cannot read {folder}: {error.strerror}") from error
    return [name for _, name in sorted(found, reverse=True)]


def _octets(data: bytes) -> npt.NDArray[np.uint8]:
    return np.frombuffer(data, np.uint8)
