"""Single-producer single-consumer rings in shared memory, which connect flight and comms.

A ring is an anonymous file (memfd) that a child process inherits by its descriptor. The producer
owns `head` and `dropped`, the consumer owns `tail`; each is a 64-bit counter that only grows, so
full and empty cannot be confused and no lock is shared. The producer never waits: when the ring is
full, nothing is written and the loss is counted. Counters are in the shared memory, so a consumer
that is restarted continues where the previous one stopped. A consumer may also read records and
free their slots later, when they are stored safely; records that it had read but not freed when it
died are still available.
"""

from __future__ import annotations

import mmap
import os
import platform
import struct
import threading

import numpy as np

from quadrotor.records import Record

# Index in 8-byte words: each on its own 64-byte cache line.
HEAD, TAIL, DROPPED, READ = 0, 8, 16, 24
HEADER_BYTES = 256
LENGTH = struct.Struct("<I")

_TOTAL_STORE_ORDER = platform.machine() in ("x86_64", "AMD64", "i686")
_lock = threading.Lock()


def fence() -> None:
    """Order the stores of a slot before the store of its counter (and loads likewise).

    x86 keeps that order by itself. Elsewhere two pairs of an uncontended lock act as a full
    barrier: one pair alone would let both stores move inside it and swap there.
    """
    if _TOTAL_STORE_ORDER:
        return
    with _lock:
        pass
    with _lock:
        pass


class _Ring:
    """Counters and memory common to both kinds of ring."""

    def __init__(self, fd: int, slots: int, slot_size: int) -> None:
        self.fd = fd
        self.slots = slots
        self.slot_size = slot_size
        size = HEADER_BYTES + slots * slot_size
        if os.fstat(fd).st_size != size:
            raise ValueError(
                f"ring of {os.fstat(fd).st_size} bytes on descriptor {fd}, expected {size}: "
                "both ends must be made with the same sizes"
            )
        self._memory = mmap.mmap(fd, size)
        self._words = memoryview(self._memory)[:HEADER_BYTES].cast("Q")

    @property
    def dropped(self) -> int:
        """Return how many messages the producer had to drop, since the ring was created."""
        return self._words[DROPPED]

    @property
    def pushed(self) -> int:
        """Return how many messages were pushed, since the ring was created."""
        return self._words[HEAD]

    def __len__(self) -> int:
        """Return the number of waiting messages; exact for the two ends, else a snapshot."""
        return self._words[HEAD] - self._words[TAIL]


def create(slots: int, slot_size: int, name: str = "ring") -> int:
    """Create a zeroed ring; return the inheritable descriptor for pass_fds."""
    fd = os.memfd_create(f"quadlab-{name}", 0)
    os.ftruncate(fd, HEADER_BYTES + slots * slot_size)
    return fd


class ByteRing(_Ring):
    """A ring of messages of variable length, at most `slot_size - 4` bytes each."""

    @property
    def longest(self) -> int:
        """Return the size of the longest message that fits, in bytes."""
        return self.slot_size - LENGTH.size

    def push(self, message: bytes) -> bool:
        """Append, or count a drop and return False when full or too long."""
        words = self._words
        head = words[HEAD]
        if head - words[TAIL] >= self.slots or len(message) > self.longest:
            words[DROPPED] += 1
            return False
        start = HEADER_BYTES + head % self.slots * self.slot_size
        data = start + LENGTH.size
        LENGTH.pack_into(self._memory, start, len(message))
        self._memory[data : data + len(message)] = message
        fence()
        words[HEAD] = head + 1
        return True

    def pop(self) -> bytes | None:
        """Return the oldest message, or None when the ring is empty."""
        words = self._words
        tail = words[TAIL]
        if tail == words[HEAD]:
            return None
        fence()
        start = HEADER_BYTES + tail % self.slots * self.slot_size
        data = start + LENGTH.size
        length: int = LENGTH.unpack_from(self._memory, start)[0]
        message = self._memory[data : data + length]
        fence()
        words[TAIL] = tail + 1
        return message

    def pop_all(self) -> list[bytes]:
        """Return all messages that are waiting now, oldest first."""
        messages: list[bytes] = []
        for _ in range(len(self)):
            message = self.pop()
            if message is None:
                break
            messages.append(message)
        return messages


class RecordRing(_Ring):
    """Ring of numpy records of one dtype, consumed by `pop`, `pop_all`, or `read` and `free`."""

    def __init__(self, fd: int, dtype: np.dtype[np.void], slots: int) -> None:
        super().__init__(fd, slots, dtype.itemsize)
        self.dtype = dtype
        self._freeing = threading.Lock()
        self._ahead = 0  # records freed before their turn

    def push(self, record: Record) -> bool:
        """Append the record, shape (1,), or count a drop and return False when full."""
        words = self._words
        head = words[HEAD]
        if head - words[TAIL] >= self.slots:
            words[DROPPED] += 1
            return False
        start = HEADER_BYTES + head % self.slots * self.slot_size
        self._memory[start : start + self.slot_size] = record.tobytes()
        fence()
        words[HEAD] = head + 1
        return True

    def pop(self) -> Record | None:
        """Return a copy of the oldest record, shape (1,), or None when the ring is empty."""
        words = self._words
        tail = words[TAIL]
        if tail == words[HEAD]:
            return None
        fence()
        record = np.frombuffer(bytearray(self._bytes(tail % self.slots, 1)), self.dtype)
        fence()
        words[TAIL] = tail + 1
        return record

    def pop_all(self) -> Record:
        """Return a read-only copy of all records that are waiting now, oldest first, shape (N,)."""
        head = self._words[HEAD]
        records = self._copy(self._words[TAIL], head)
        self._words[TAIL] = head
        return records

    def read(self) -> Record:
        """Read as `pop_all` does, but keep the slots occupied until `free`."""
        words = self._words
        head = words[HEAD]
        records = self._copy(max(words[READ], words[TAIL]), head)
        words[READ] = head
        return records

    @property
    def was_read(self) -> bool:
        """Return whether records have been read, by this consumer or the one that it replaces."""
        return self._words[READ] > 0

    def read_before(self) -> Record:
        """Return records read but not freed, shape (N,), for a consumer that was restarted."""
        return self._copy(self._words[TAIL], max(self._words[READ], self._words[TAIL]))

    def free(self, count: int) -> None:
        """Free the oldest `count` records read, which are stored safely; from any thread."""
        with self._freeing:
            early = min(count, self._ahead)
            self._ahead -= early
            self._words[TAIL] += count - early

    def free_ahead(self, count: int) -> None:
        """Make room for the producer before the oldest records read are stored safely.

        `free` them nevertheless.
        """
        with self._freeing:
            self._ahead += count
            self._words[TAIL] += count

    def _copy(self, tail: int, head: int) -> Record:
        fence()
        first, count = tail % self.slots, head - tail
        # As bytes, because numpy copies structured rows field by field, forty times slower.
        data = self._bytes(first, min(count, self.slots - first))
        if first + count > self.slots:
            data += self._bytes(0, first + count - self.slots)
        fence()
        return np.frombuffer(data, self.dtype)

    def _bytes(self, first: int, count: int) -> bytes:
        start = HEADER_BYTES + first * self.slot_size
        return self._memory[start : start + count * self.slot_size]
