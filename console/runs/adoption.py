"""Reconciliation of catalogue and runs folder: torn logs are closed, unknown runs are added."""

from __future__ import annotations

import shutil
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from console.catalogue.catalogue import Catalogue, runs_in
from console.catalogue.marks import find_mark, store_mark
from console.catalogue.tables import Mark, RunEntry
from console.runs.trash import finish_moves, is_deleted, is_in_trash
from flight_log.file import is_being_written
from flight_log.index import is_closed
from flight_log.reader import read_topic
from flight_log.recovery import recover
from flight_log.run_folder import STATION, log_of, run_bytes, station_log
from flight_log.summary import LogSummary, summarize
from quadrotor.errors import LogFormatError, StorageError, os_errors
from vehicle_link.messages import decode, stamp_of
from vehicle_link.topics.table import TOPICS

EARLIEST_NS = 10**18
"""Epoch, in ns (2001), before which nothing was recorded: simulated time begins at 0."""
NO_STATION_LOG = f"{STATION} is missing in its folder; what the vehicle logged is there"


def tidy_runs(catalogue: Catalogue, skip: Collection[str] = ()) -> list[str]:
    """Check every file and every row once; return one line for each repair or problem.

    Files that any process is writing, and runs named in `skip`, are left alone. Raises StorageError
    when folder or catalogue cannot be used.
    """
    lines = finish_moves(catalogue)
    shutil.rmtree(catalogue.folder / ".replay", ignore_errors=True)  # an older version's caches
    known = {entry.id: entry for entry in catalogue.runs(limit=1_000_000)}
    with os_errors(lambda why: f"cannot list {catalogue.folder}: {why}"):
        paths = runs_in(catalogue.folder)
    folders = {path.name for path in paths if path.is_dir()}
    for path in paths:
        if path.stem in folders and not path.is_dir():
            lines.append(
                f"two runs are called {path.stem}: rename {path.name}, which is left alone"
            )
        elif path.stem not in skip:
            lines += _tidy_file(catalogue, path, known.pop(path.stem, None))
        else:
            known.pop(path.stem, None)
    for entry in known.values():
        if entry.id not in skip and _is_gone(catalogue, entry):
            catalogue.update(entry.id, complete=False, problem="the file is gone")
            if entry.problem != "the file is gone":
                lines.append(f"run {entry.id}: the file is gone")
    return lines


def _is_gone(catalogue: Catalogue, entry: RunEntry) -> bool:
    """Return whether the file is neither in the folder nor in the trash, to which a deletion in
    progress has moved it.
    """
    log = log_of(catalogue.folder / entry.file)
    # Checked twice: it may be moved back between the two checks.
    return not (log.is_file() or is_in_trash(catalogue, entry.file) or log.is_file())


def _tidy_file(catalogue: Catalogue, path: Path, entry: RunEntry | None) -> list[str]:
    if entry is None and is_deleted(catalogue, path.stem):
        return []  # it is being restored
    try:
        log = station_log(path) if station_log(path).is_file() else log_of(path)
        closed = is_closed(log)
        known = entry is not None and entry.complete and entry.file == path.name
        if (closed and known) or is_being_written(path):
            return []
        recovery = recover(log)  # also for a closed log whose index is damaged
        problem = _enter(catalogue, path, entry)
    except (LogFormatError, StorageError) as error:
        if not path.exists():
            return []  # it was deleted in the meantime
        catalogue.add(_unreadable(path, entry, str(error)))
        return [f"run {path.stem}: {error}"]
    if problem:
        return [f"run {path.stem}: {problem}"]
    if not recovery.torn:
        return [f"run {path.stem}: entered in the catalogue"]
    return [
        f"run {path.stem}: recovered {recovery.messages} messages of a recording that was cut off"
        + (f"; as it was, it is kept as {recovery.kept.name}" if recovery.kept else "")
    ]


def _enter(catalogue: Catalogue, path: Path, entry: RunEntry | None) -> str:
    """Add a run with its marks to the catalogue; return what is wrong with it."""
    found = described(path, entry)
    catalogue.add(found)
    store_marks_of_log(catalogue, path, path.stem)
    return found.problem


def described(path: Path, entry: RunEntry | None) -> RunEntry:
    """Return the catalogue entry of a closed file, from the file itself.

    Raises LogFormatError or StorageError.
    """
    summary = summarize(path)
    return RunEntry(
        id=path.stem,
        vehicle=summary.run.get("vehicle", entry.vehicle if entry else ""),
        start_ns=entry.start_ns if entry else _start_ns(path, summary),
        duration=summary.duration,
        file=path.name,
        bytes=run_bytes(path),
        messages=summary.message_count,
        operator=summary.run.get("operator", ""),
        complete=summary.closed,
        recovered=summary.recovered,
        problem="" if station_log(path).is_file() else NO_STATION_LOG,
        notes=entry.notes if entry else "",
    )


def _start_ns(path: Path, summary: LogSummary) -> int:
    """Return when a run began, epoch ns: from the file's time where the log has simulated time."""
    if summary.start_ns >= EARLIEST_NS:
        return summary.start_ns
    with os_errors(lambda why: f"cannot read {path.name}: {why}"):
        return log_of(path).stat().st_mtime_ns - round(1e9 * summary.duration)


def update_entry(catalogue: Catalogue, path: Path) -> None:
    """Update a run's size, count and location in the catalogue; its other facts stay.

    Raises LogFormatError or StorageError.
    """
    entry = catalogue.get(path.stem)
    found = described(path, entry)
    catalogue.add(replace(found, problem=entry.problem, operator=entry.operator))


def _unreadable(path: Path, entry: RunEntry | None, problem: str) -> RunEntry:
    known = entry or RunEntry(path.stem, "", 0, 0.0, path.name)
    return RunEntry(
        id=path.stem,
        vehicle=known.vehicle,
        start_ns=known.start_ns,
        duration=0.0,
        file=path.name,
        bytes=run_bytes(path) if path.exists() else 0,
        operator=known.operator,
        problem=problem,
        notes=known.notes,
    )


def marks_in_log(log: Path, run_id: str) -> list[Mark]:
    """Return the marks of a closed file, each with its newest text.

    Raises LogFormatError or StorageError.
    """
    found: dict[str, Mark] = {}
    for payload in read_topic(log, "marks"):
        sent = decode(payload, TOPICS["marks"].type_name)
        before = found.get(sent.id)
        mark = Mark(
            run_id=run_id,
            id=sent.id,
            stamp_ns=stamp_of(sent),
            time=sent.time,
            text=sent.text,
            requester=sent.requester,
        )
        found[sent.id] = replace(before, text=mark.text) if before else mark
    return list(found.values())


def store_marks_of_log(catalogue: Catalogue, log: Path, run_id: str) -> None:
    """Store the marks of a run that the catalogue did not have. Raises StorageError or
    LogFormatError.
    """
    for mark in marks_in_log(log, run_id):
        if find_mark(catalogue, mark.id) is None:
            store_mark(catalogue, mark)
