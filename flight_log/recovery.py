"""Repair of the log of a killed writer: it gets its index, so that every tool can open it again."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from mcap.records import Attachment, Channel, Header, Metadata, Schema

from flight_log.file import LogFile, is_being_written, open_log, sync_folder
from flight_log.index import RECOVERED_METADATA, index_problem
from flight_log.mcap_writer import McapWriter
from flight_log.records import RawMessage, ReadState, records
from flight_log.run_folder import station_log
from quadrotor.errors import LogFormatError, StorageError, os_errors

PIECE = 1 << 20
"""Bytes; a killed writer leaves less than this after the tear."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """The result of `recover`."""

    path: Path
    torn: bool  # False: the file was closed properly and was left alone
    messages: int = 0  # kept
    lost_bytes: int = 0  # after the last intact record
    damaged_chunks: int = 0  # left out
    reason: str = ""
    kept: Path | None = None  # the original file, if more than zeros followed the tear


def recover(path: Path) -> Recovery:
    """Rewrite a torn file in place, atomically; one with a sound index is left alone. For a run's
    folder this is the station's log.

    The new file has the metadata record `quadlab.recovered`. A file that is damaged in its middle
    is kept next to it as `.torn`.

    Raises:
        LogFormatError: this is not an MCAP file, or it is of an unsupported kind.
        StorageError: it is being written or repaired by another process, or there is no room for
            the copy. The torn file stays as it was.
    """
    path = station_log(path)
    if not index_problem(path):
        return Recovery(path, torn=False)
    with os_errors(lambda why: f"cannot repair {path}: {why}"):
        path = path.resolve(strict=True)  # the target of a link, not the link itself
        if is_being_written(path):
            raise StorageError(f"{path} is being written now; stop the recording first")
        target = LogFile(path.with_suffix(".recovering"), replace=True)
        try:
            # Another process may have repaired it before this one locked the copy.
            problem = index_problem(path)
            return _repair(path, target, problem) if problem else Recovery(path, torn=False)
        finally:
            target.path.unlink(missing_ok=True)
            target.close()


def _repair(path: Path, target: LogFile, problem: str) -> Recovery:
    """Repair a log, and return the result; `problem` is that of its index."""
    state = ReadState()
    writer = McapWriter(target)
    count = _copy(path, writer, state)
    reason = state.tear or problem
    lost = path.stat().st_size - state.whole_bytes if state.tear else 0
    writer.add_metadata(
        RECOVERED_METADATA,
        {
            "reason": reason,
            "messages": str(count),
            "lost_bytes": str(lost),
            "damaged_chunks": str(state.damaged_chunks),
        },
    )
    writer.finish()
    target.sync()
    kept = path.with_suffix(".torn") if _holds_more(path, state.whole_bytes) else None
    if kept is not None:
        os.replace(path, kept)
    os.replace(target.path, path)
    sync_folder(path.parent)
    return Recovery(
        path,
        True,
        messages=count,
        lost_bytes=lost,
        damaged_chunks=state.damaged_chunks,
        reason=reason,
        kept=kept,
    )


def _holds_more(path: Path, whole_bytes: int) -> bool:
    """Return whether more follows the tear than the piece that a killed writer leaves, and than
    zeros.
    """
    with open_log(path) as stream:
        stream.seek(whole_bytes + PIECE)
        return any(stream.read(PIECE))


def _copy(path: Path, writer: McapWriter, state: ReadState) -> int:
    """Copy all intact records; return the number of messages."""
    schemas: dict[int, int] = {0: 0}  # 0: a channel without one
    channels: dict[int, int] = {}
    count, started = 0, False
    for record in records(path, state):
        if not started:
            profile = record.profile if isinstance(record, Header) else "ros2"
            writer.start(profile=profile, library="quadlab")
            started = True
        match record:
            case RawMessage():
                channel = channels.get(record.channel_id)
                if channel is not None:
                    count += 1
                    writer.add_message(
                        channel, record.log_ns, record.payload, record.publish_ns, record.sequence
                    )
            case Schema() if record.id not in schemas:
                schemas[record.id] = writer.register_schema(
                    record.name, record.encoding, record.data
                )
            case Channel() if record.id not in channels and record.schema_id in schemas:
                channels[record.id] = writer.register_channel(
                    record.topic,
                    record.message_encoding,
                    schemas[record.schema_id],
                    record.metadata,
                )
            case Attachment():
                writer.add_attachment(record)
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case _:
                pass
    if not started:
        raise LogFormatError(f"{path.name} has no record that can be read; nothing to recover")
    return count
