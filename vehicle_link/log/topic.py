"""The messages of one topic of a closed log, found by its index: only the chunks with them are
opened."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from mcap.reader import make_reader

from quadrotor.errors import LogFormatError, StorageError
from vehicle_link.log.file import open_log
from vehicle_link.log.walk import UNREADABLE


def read_topic(path: Path, name: str) -> Iterator[bytes]:
    """Payloads in CDR of `/<vehicle>/<name>` of any vehicle, in the order of log time.

    Raises LogFormatError or StorageError; a log without the topic has none.
    """
    try:
        with open_log(path) as stream:
            reader = make_reader(stream)
            index = reader.get_summary()
            if index is None:
                raise LogFormatError(f"{path} has no index; try: quadlab log recover")
            topics = [c.topic for c in index.channels.values() if c.topic.endswith(f"/{name}")]
            if not topics:
                return
            for _, _, message in reader.iter_messages(topics=topics):
                yield message.data
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
    except (*UNREADABLE, KeyError) as error:
        raise LogFormatError(
            f"{path} has a damaged index ({error}); try: quadlab log recover"
        ) from error
