"""What of a log with a sound index cannot be read any more."""

from __future__ import annotations

from pathlib import Path

from flight_log.records import ReadState, records

_YEAR = 3.2e7  # s; a longer time is a damaged one


def damage(path: Path) -> list[str]:
    """A line for each damaged chunk or other record: where it is, and from when.

    Reads the whole file. Raises LogFormatError or StorageError.
    """
    state, start_ns = ReadState(), 0
    for record in records(path, state):
        start_ns = start_ns or getattr(record, "log_ns", 0)
    found = []
    for one in state.damaged:
        what = "a chunk" if one.is_chunk else "an attachment, metadata or a description"
        # The times stand before what is compressed, and may be damaged themselves.
        since, until = ((ns - start_ns) * 1e-9 for ns in one.times_ns)
        is_sound = one.is_chunk and 0.0 <= since <= until < _YEAR
        when = f", with the messages from {since:.3f} to {until:.3f} s" if is_sound else ""
        found.append(f"{what} of {one.size} bytes at byte {one.place}{when}")
    if left := state.damaged_chunks + state.damaged_records - len(found):
        found.append(f"{left} more such records")
    return found
