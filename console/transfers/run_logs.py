"""The vehicle's own logs of a run: fetched whole into its folder, merged with the station's."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from console.catalogue.completeness import SHORTEST_REPORTED, Completeness, State
from console.runs.report_folders import report_folder
from console.transfers.download import Download
from console.transfers.job import NotYetError
from console.transfers.vehicle_files import VehicleFile
from flight_log.file import sync_folder
from flight_log.merge import LEAD_NS, merge
from flight_log.run_folder import STATION, VEHICLE, run_bytes, vehicle_logs
from flight_log.vehicle_messages import EDGE_NS, Comparison, vehicle_times
from quadrotor.errors import os_errors
from vehicle_link.jobs import run


def complete_run(
    folder: Path, download: Download, check: Callable[[], None], run: Callable[..., Any] = run
) -> Completeness:
    """Fetch what the vehicle logged during a run, and merge both logs; return the completeness.

    Args:
        check: raises when the work is to end.
        run: like vehicle_link.jobs.run.

    Raises as `Download` does, and LogFormatError; fetched files stay for the next try.
    """
    job = download.job
    job.phase = "checking"
    began_ns, ended_ns, first_ns, last_ns = run(vehicle_times, folder, check=check)
    on_board = download.files.files()
    wanted = logs_of(on_board, began_ns - LEAD_NS, ended_ns)
    is_covered = any(
        file.start_ns <= first_ns + EDGE_NS and file.end_ns >= last_ns - LEAD_NS for file in wanted
    )
    torn = [file for file in on_board if not file.closed and not file.start_ns]
    for file in (*wanted, *torn * (not is_covered)):
        if not file.closed:
            raise NotYetError(download.files.why_open(file))
    for file in wanted:
        copies = [*vehicle_logs(folder), download.folder / file.name]
        copies += (path for one in folder.parent.iterdir() for path in vehicle_logs(one))
        download.fetch(file, folder, VEHICLE, copies)
    download.room(run_bytes(folder))
    job.phase = "merging"
    oldest_ns = min((file.start_ns for file in on_board), default=0)
    return completeness(run(merge, folder, oldest_ns, check=check))


def completeness(found: Comparison) -> Completeness:
    """Return the catalogue's entry for a comparison."""
    state: State = "filled" if found.filled >= SHORTEST_REPORTED else "complete"
    why = f"{found.ticks} ticks, compared with the vehicle's log"
    if found.missing:
        state, why = "missing", found.why
    elif not found.ticks:
        state, why = "unknown", "it has no ticks of the vehicle"
    elif not found.messages:
        why = "no gaps"
    why = "; ".join([why, *found.problems])
    return Completeness(state, found.filled, found.missing, found.total, why)


def logs_of(on_board: list[VehicleFile], since_ns: int, until_ns: int) -> list[VehicleFile]:
    """Return the files that overlap an interval of the vehicle's clock, oldest first."""
    found = [
        file
        for file in on_board
        if 0 < file.start_ns <= until_ns and (file.end_ns >= since_ns or not file.closed)
    ]
    return sorted(found, key=lambda file: file.start_ns)


def into_folder(log: Path) -> Path:
    """Convert a run that is a single file, as written by older versions, to a folder; return the
    folder. Raises StorageError.
    """
    if log.is_dir():
        return log
    folder = log.with_suffix("")
    with os_errors(lambda why: f"cannot make the folder {folder}: {why}"):
        folder.mkdir()
        if (report := report_folder(log)).exists():
            report.rename(report_folder(folder))
        log.rename(folder / STATION)
        sync_folder(folder.parent)
    return folder
