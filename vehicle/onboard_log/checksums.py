"""SHA-256 of closed onboard logs, computed in pieces by a thread of low priority.

A gigabyte takes seconds, so the caller asks again until the result is available.
"""

from __future__ import annotations

import hashlib
import os
import threading
from collections import OrderedDict
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue

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
