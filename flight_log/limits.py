"""Limits on how much of a log is held at once.

A log may come from anyone, and a chunk of a megabyte can hold gigabytes. With these limits no
reader needs more than 500 MB, whatever a log claims or holds.
"""

from __future__ import annotations

import resource
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from quadrotor.errors import LogFormatError

MAX_BYTES = 80_000_000
"""Largest record, and decompressed chunk: ours have 64 KiB, other writers' up to 64 MiB."""
MAX_DESCRIPTION = 4_000_000
"""Largest schema, channel or metadata record."""
MAX_KEPT = 64_000_000
"""Largest size of all descriptions, metadata and attachments of a log together."""
MAX_TIMES = 256
"""Largest compression ratio of lz4: a chunk that claims more is damaged. zstd has none."""
MAX_FOREIGN = 400_000_000
"""Memory that another project's reader may use in addition to what the process has."""
MAX_UNPACKED = 4_000_000_000
"""Largest file that such a reader may unpack."""
PAIR_BYTES = 150
"""Size of two short texts in a map, without their letters."""
FRAME = 64
"""Bytes that lz4 adds to the smallest piece of data."""


def check_record(name: str, size: int, place: int) -> None:
    """Check a record; `place` is its offset in the file. Raises LogFormatError if too large."""
    if size > MAX_BYTES:
        raise LogFormatError(
            f"{name} has a record of {size / 1e6:.0f} MB at byte {place}; "
            f"at most {MAX_BYTES // 10**6} MB are read"
        )


def check_chunk(name: str, compression: str, stored: int, claimed: int) -> None:
    """Check a chunk before it is decompressed.

    Args:
        stored: its bytes in the file, compressed.
        claimed: its decompressed bytes, as it claims.

    Raises ValueError when the claim is impossible, LogFormatError when it is too large.
    """
    if compression != "zstd" and claimed > MAX_TIMES * (stored + FRAME):
        raise ValueError("it claims more than lz4 can compress into it")
    if claimed > MAX_BYTES:
        raise LogFormatError(
            f"{name} has a chunk of {stored / 1e6:.1f} MB that opens to {claimed / 1e6:.0f} MB; at "
            f"most {MAX_BYTES // 10**6} MB are opened: rewrite it in smaller ones with "
            "`mcap compress --compression lz4 --chunk-size 4194304`"
        )


def map_bytes(words: Mapping[str, str]) -> int:
    """Return the size of texts by name in Python's memory."""
    return sum(len(name) + len(text) + PAIR_BYTES for name, text in words.items())


@contextmanager
def bounded_reader(name: str) -> Iterator[None]:
    """Limit memory and files of a reader that checks neither sizes nor nesting itself. Raises
    LogFormatError.

    The limits are the kernel's and apply to the whole process, so only a command that does nothing
    else may use them.
    """
    status = Path("/proc/self/status").read_text()
    held = 1024 * int(status.partition("VmData:")[2].split()[0])
    bounds = {resource.RLIMIT_DATA: held + MAX_FOREIGN, resource.RLIMIT_FSIZE: MAX_UNPACKED}
    before = {kind: resource.getrlimit(kind) for kind in bounds}
    try:
        for kind, bound in bounds.items():
            soft, hard = before[kind]
            resource.setrlimit(
                kind, (bound if soft == resource.RLIM_INFINITY else min(soft, bound), hard)
            )
        yield
    except MemoryError:
        raise LogFormatError(
            f"{name} needs more than {MAX_FOREIGN // 10**6} MB of memory to be read; cut it into "
            "flights, or write it with smaller chunks"
        ) from None
    except RecursionError:
        raise LogFormatError(f"{name} describes itself in too deep a nest to be read") from None
    finally:
        for kind, limits in before.items():
            resource.setrlimit(kind, limits)


class MemoryBudget:
    """Counter of what a reader holds of a log in addition to its messages."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._sizes: dict[object, int] = {}
        self._total = 0

    def has_room(self, size: int) -> bool:
        return 2 * (self._total + size) <= MAX_KEPT

    def add(self, what: object, size: int) -> None:
        """Count an item that is held; the same `what` replaces the previous one. Raises
        LogFormatError.
        """
        self._total += size - self._sizes.get(what, 0)
        self._sizes[what] = size
        if self._total > MAX_KEPT:
            raise LogFormatError(
                f"{self._name} has more than {MAX_KEPT // 10**6} MB of descriptions and metadata; "
                "so many are not read"
            )
