"""A whole log of the vehicle, into `<data>/onboard/<vehicle>/`."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from console.transfers.fetcher import ChangedError, Fetcher
from console.transfers.job import Job, NotYetError
from console.transfers.part_file import PartFile, unwant
from console.transfers.vehicle_files import VehicleFile, VehicleFiles, why_open
from flight_log.file import sync_folder
from quadrotor.errors import StorageError

BLOCK = 1 << 20
SUM_PAUSE = 0.2
"""s until a checksum that is being computed is asked for again."""
SUMS = 600
"""Times it is asked for."""


def download(
    job: Job,
    folder: Path,
    files: VehicleFiles,
    fetcher: Fetcher,
    room: Callable[[int], None],
    wait: Callable[[float], None],
) -> None:
    """Fetch, check, and only then give it its name.

    Args:
        room: raises when so many more bytes do not fit on the disk.

    Raises ChangedError, CancelledError, NotYetError, LinkError, RefusedError or StorageError;
    what came stays.
    """
    file = _closed(job, files)
    place = folder / file.name
    if place.exists() and place.stat().st_size == file.size:
        job.phase = "checking"
        if sum_of(place, job.check) == _sum_on_board(job, file, files, wait):
            unwant(folder, file.name)
            job.bytes = job.total_bytes = file.size
            job.end("done", "it was here already")
            return
    part = PartFile(folder, file, wanted=True)
    try:
        if part.restarted:
            job.problem = "another file has this name on board now; begun again"
        job.bytes, job.total_bytes, job.phase = part.size, file.size, "fetching"
        room(file.size - part.size)
        fetcher.fetch(part, [(0, file.size)])
        room(0)  # the folder itself may have vanished meanwhile
        job.phase = "checking"
        part.sync()
        if sum_of(part.path, job.check) != _sum_on_board(job, file, files, wait):
            part.remove()
            raise ChangedError(file)
        os.replace(part.path, free_place(place))
        part.remove()
        sync_folder(folder)
    finally:
        part.close()
    job.end("done")


def free_place(place: Path) -> Path:
    """Return `place`, or with `_2`, `_3`, … when another log has that name: logs are never
    replaced.
    """
    found, number = place, 1
    while found.exists():
        number += 1
        found = place.with_name(f"{place.stem}_{number}{place.suffix}")
    return found


def sum_of(path: Path, check: Callable[[], None] = lambda: None) -> bytes:
    """Return the SHA-256. Raises StorageError, and what `check` raises between two blocks."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while block := stream.read(BLOCK):
                digest.update(block)
                check()
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror}") from error
    return digest.digest()


def _closed(job: Job, files: VehicleFiles) -> VehicleFile:
    file, _ = files.part(job.name, 0, 8)
    if not file.closed:
        raise NotYetError(why_open(files, file))
    return file


def _sum_on_board(
    job: Job, file: VehicleFile, files: VehicleFiles, wait: Callable[[float], None]
) -> bytes:
    """Return the checksum that is computed on board, which takes a while."""
    for _ in range(SUMS):
        job.check()
        now, digest = files.sha256(file.name)
        if now.identity != file.identity:
            raise ChangedError(now)
        if digest:
            return digest
        wait(SUM_PAUSE)
    raise StorageError(f"the vehicle does not come to the end of the checksum of {file.name}")
