"""A run written again with what it lacked, and put in the place of the old file at once."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mcap.records import Attachment, Metadata

from flight_log.file import LogFile, is_being_written, sync_folder
from flight_log.filling import Filling, Placed
from flight_log.mcap_writer import McapWriter
from flight_log.records import RawMessage, records
from flight_log.run_index import RunIndex
from flight_log.writer import FILLED_METADATA
from quadrotor.errors import StorageError
from vehicle_link import messages


def write_filled(
    run: Path,
    index: RunIndex,
    filling: Filling,
    told: Mapping[str, str],
    progress: Callable[[float], None] = lambda share: None,
) -> int:
    """Write the run again next to it and take its place, at once and as a whole; messages added.

    Args:
        told: the metadata record `quadlab.filled`, instead of an earlier one.

    Raises LogFormatError, or StorageError when there is no room, the run is being written or it
    was changed or deleted meanwhile; then it stays as it was.
    """
    remove_leftovers(run)
    before = run.stat()
    target = LogFile(run.with_name(f"{run.stem}.{os.getpid()}.filling"), replace=True)
    try:
        writer = McapWriter(target)
        added = _copy(run, index, writer, filling, lambda: progress(target.size / before.st_size))
        writer.add_metadata(FILLED_METADATA, dict(told))
        writer.finish()
        target.sync()
        _take_place(target.path, run, before)
    finally:
        target.close()
        target.path.unlink(missing_ok=True)
    return added


def remove_leftovers(run: Path) -> None:
    """Remove what a writer that was killed left next to the run."""
    for path in run.parent.glob(f"{run.stem}.*.filling"):
        if not is_being_written(path):
            path.unlink(missing_ok=True)


def filled_before(index: RunIndex) -> dict[str, Any]:
    """Return what the run's own record says was filled in so far: names of files, numbers of
    messages and ticks.
    """
    told = index.metadata.get(FILLED_METADATA, {})
    try:
        return {
            "files": list(json.loads(told["files"])),
            "messages": int(told["messages"]),
            "ticks": int(told["ticks"]),
        }
    except (KeyError, ValueError):
        return {"files": [], "messages": 0, "ticks": 0}


def _copy(
    run: Path, index: RunIndex, writer: McapWriter, filling: Filling, tell: Callable[[], None]
) -> int:
    writer.start()
    schemas = {
        number: writer.register_schema(one.name, one.encoding, one.data)
        for number, one in index.schemas.items()
    }
    channels: dict[int, int] = {}
    by_topic: dict[str, int] = {}
    for number, one in index.channels.items():
        its = schemas.get(one.schema_id, 0)
        channels[number] = writer.register_channel(
            one.topic, one.message_encoding, its, one.metadata
        )
        by_topic[one.topic] = channels[number]
    count = added = 0
    more = filling.placed()
    following = next(more, None)

    def add(placed: Placed) -> None:
        topic = f"/{index.vehicle}/{placed.message.topic}"
        if topic not in by_topic:
            by_topic[topic] = _register(writer, topic, placed.message.type_name)
        writer.add_message(
            by_topic[topic], placed.log_ns, placed.message.payload, placed.stamp_ns, count
        )

    for record in records(run):
        if isinstance(record, RawMessage):
            while following is not None and following.log_ns < record.log_ns:
                count, added = count + 1, added + 1
                add(following)
                following = next(more, None)
            if record.channel_id in channels:
                count += 1
                writer.add_message(
                    channels[record.channel_id],
                    record.log_ns,
                    record.payload,
                    record.publish_ns,
                    count,
                )
                if count % 10_000 == 0:
                    tell()
        elif isinstance(record, Attachment):
            writer.add_attachment(record)
        elif isinstance(record, Metadata) and record.name != FILLED_METADATA:
            writer.add_metadata(record.name, record.metadata)
    while following is not None:
        count, added = count + 1, added + 1
        add(following)
        following = next(more, None)
    return added


def _register(writer: McapWriter, topic: str, type_name: str) -> int:
    """Register a channel for a topic of which the run had nothing."""
    schema = writer.register_schema(
        messages.ros_name(type_name), "ros2msg", messages.definition(type_name).encode()
    )
    told = {"offered_qos_profiles": "[]", "topic_type_hash": messages.type_hash(type_name)}
    return writer.register_channel(topic, "cdr", schema, told)


def _take_place(new: Path, run: Path, before: os.stat_result) -> None:
    """Replace the run by the new file, unless another process records into, deletes or fills it
    between the look and the move.
    """
    try:
        descriptor = os.open(run, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise StorageError(f"{run.name} is gone; it was not filled") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        now = os.fstat(descriptor)
        if not os.path.samestat(now, before) or now.st_size != before.st_size:
            raise StorageError(f"{run.name} was changed meanwhile; it was not filled")
        if not os.path.samestat(now, os.stat(run)):
            raise StorageError(f"{run.name} was replaced meanwhile; it was not filled")
        os.replace(new, run)
        sync_folder(run.parent)
    except BlockingIOError:
        raise StorageError(f"{run.name} is being recorded; it was not filled") from None
    except OSError as error:
        raise StorageError(f"cannot replace {run}: {error.strerror}") from error
    finally:
        os.close(descriptor)
