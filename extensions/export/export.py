"""Export of a log's tables as files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from console.log_tables import Tables
from extensions.export.formats import Format
from quadrotor.errors import LogFormatError, StorageError, UsageError
from quadrotor.extension import Exporter
from quadrotor.extensions import registry


@dataclass(frozen=True, slots=True)
class Exported:
    """The result of an export.

    Attributes:
        problems: a line for each topic that could not be read.
        missing: the part of the file that could not be read.
        note: why its columns are not stored.
    """

    files: tuple[Path, ...]
    rows: int
    problems: tuple[str, ...]
    missing: str = ""
    note: str = ""


def export(
    log: Path,
    folder: Path,
    kind: str,
    topics: Sequence[str] = (),
    begin: float = 0.0,
    end: float = np.inf,
    progress: Callable[[float], None] = lambda share: None,
) -> Exported:
    """Export a log. Arguments are those of `console.log_tables.Tables`; `progress` is called
    with the share done, 0…1.

    Raises UsageError, LogFormatError, also when there is nothing to export, or StorageError; then
    no file has been created.
    """
    formats = registry().offers(Exporter)
    if kind not in formats:
        raise UsageError(f"unknown format {kind!r}; there are {', '.join(formats)}")
    make = formats[kind].load()
    tables = Tables(log, topics, begin, end, lambda share: progress(0.5 * share))
    made = _make(folder)
    files: Format = make(folder, log.stem, tables.run)
    rows = 0
    try:
        for piece in tables:
            files.write(piece)
            rows += piece.table.num_rows
            progress(0.5 + 0.5 * piece.share)
        problems = tuple(f"{topic}: {line}" for topic, line in tables.problems.items())
        if not rows:
            why = next(iter(problems), "") or tables.missing or "no message in that interval"
            raise LogFormatError(f"{log.name} has nothing to export: {why}")
        written = files.finish()
    except BaseException as error:
        files.discard()
        _remove(made)
        if isinstance(error, OSError):
            why = error.strerror or str(error)
            raise StorageError(
                f"cannot write into {folder}: {why}; nothing was exported; make room, or choose "
                "another disk with --out"
            ) from error
        raise
    return Exported(tuple(written), rows, problems, tables.missing, tables.note)


def _make(folder: Path) -> list[Path]:
    """Create the folder and return all folders that were created, deepest first.

    Raises UsageError when it is not empty, StorageError when it cannot be created.
    """
    missing: list[Path] = []
    try:
        missing += [one for one in (folder, *folder.parents) if not one.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise UsageError(
                f"{folder} is not empty; export into a new folder, nothing is overwritten"
            )
    except OSError as error:
        _remove(missing)
        taken = isinstance(error, FileExistsError | NotADirectoryError)
        why = "a file is there" if taken else error.strerror
        raise StorageError(
            f"cannot write into {folder}: {why}; choose a new folder with --out"
        ) from error
    return missing


def _remove(folders: list[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # not created, or it contains other files
            folder.rmdir()
