"""Give the log of a killed writer its index, so that every tool opens it again."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from quadrotor.errors import StorageError
from vehicle_link.log.file import LogFile, is_being_written
from vehicle_link.log.records import RawMessage, ReadState, records
from vehicle_link.log.writer import new_mcap_writer

RECOVERED_METADATA = "quadlab.recovered"


@dataclass(frozen=True, slots=True)
class Recovery:
    """What `recover` found."""

    path: Path
    torn: bool  # False: the file was closed properly and was left alone
    messages: int = 0  # kept
    lost_bytes: int = 0  # after the last whole record
    damaged_chunks: int = 0  # left out
    reason: str = ""


def is_closed(path: Path) -> bool:
    """True when the file has its end mark. Raises StorageError."""
    try:
        with path.open("rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            if size < 2 * len(MCAP0_MAGIC):
                return False
            stream.seek(size - len(MCAP0_MAGIC))
            return stream.read() == MCAP0_MAGIC
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error


def recover(path: Path) -> Recovery:
    """Rewrite a torn file in place, atomically; a closed one is left alone.

    The new file carries the metadata record `quadlab.recovered`.

    Raises:
        LogFormatError: this is no MCAP file.
        StorageError: it is being written now, or there is no room for the copy; then the torn
            file stays as it was.
    """
    if is_closed(path):
        return Recovery(path, torn=False)
    if is_being_written(path):
        raise StorageError(f"{path} is being written now; stop the recording first")
    state = ReadState()
    target = LogFile(path.with_suffix(".recovering"), replace=True)
    try:
        writer = new_mcap_writer(target)
        count = _copy(path, writer, state)
        lost = path.stat().st_size - state.whole_bytes
        writer.add_metadata(
            RECOVERED_METADATA,
            {
                "reason": state.tear,
                "messages": str(count),
                "lost_bytes": str(lost),
                "damaged_chunks": str(state.damaged_chunks),
            },
        )
        writer.finish()
        target.sync()
        os.replace(target.path, path)
        _sync_folder(path.parent)
    finally:
        target.close()
        target.path.unlink(missing_ok=True)
    return Recovery(path, True, count, lost, state.damaged_chunks, state.tear)


def _copy(path: Path, writer: Any, state: ReadState) -> int:
    """All whole records; returns the number of messages."""
    writer.start(profile="ros2", library="quadlab")
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count = 0
    for record in records(path, state):
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
                writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            case Metadata():
                writer.add_metadata(record.name, record.metadata)
            case _:
                pass
    return count


def _sync_folder(folder: Path) -> None:
    """Make the new name durable."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
