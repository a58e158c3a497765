"""Whole logs of the vehicle, checked, into `<data>/onboard/<vehicle>/` or a run's folder."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from console.transfers.fetcher import ChangedError, Fetcher
from console.transfers.job import Job, NotYetError
from console.transfers.part_file import PartFile, discard
from console.transfers.vehicle_files import VehicleFile, VehicleFiles
from flight_log.file import sync_folder
from quadrotor.errors import StorageError, os_errors

BLOCK = 1 << 20
SUM_PAUSE = 0.2
"""Seconds between requests for a checksum that is being computed."""
CHECKSUM_REQUESTS = 600
"""Maximum number of requests for it."""


@dataclass(frozen=True)
class Download:
    """Fetches whole logs of the vehicle to this disk.

    Args:
        folder: of files in progress.
        room: raises when this many more bytes do not fit on the disk.
        wait: waits for this many s; raises when the station closes.

    Its methods raise ChangedError, CancelledError, NotYetError, LinkError, RefusedError or
    StorageError; what was received stays for the next try.
    """

    job: Job
    folder: Path
    files: VehicleFiles
    fetcher: Fetcher
    room: Callable[[int], None]
    wait: Callable[[float], None]

    def by_name(self) -> None:
        """Fetch the log that the job names into the folder."""
        file, _ = self.files.part(self.job.name, 0, 8)
        is_here = self.fetch(file, self.folder, file.name, [self.folder / file.name])
        discard(self.folder, file.name)
        self.job.end("done", "it had been downloaded before" if is_here else "")

    def fetch(self, file: VehicleFile, folder: Path, name: str, copies: Iterable[Path]) -> bool:
        """Fetch a log into a folder, check it, and only then give it its name, with `_2`, `_3`, …
        when another log has that; return whether one of `copies` was the same log.
        """
        job = self.job
        if not file.closed:
            raise NotYetError(self.files.why_open(file))
        same_size = [one for one in copies if one.exists() and one.stat().st_size == file.size]
        job.phase = "checking" if same_size else "fetching"
        for copy in same_size:
            if sha256_of(copy, job.check) == self._sum_on_board(file):
                job.bytes = job.total_bytes = file.size
                if copy.parent == folder or _linked(copy, free_path(folder / name)):
                    return True
        part = PartFile(folder, file)
        try:
            if part.restarted:
                job.problem = "another file has this name on board now; starting over"
            job.bytes, job.total_bytes, job.phase = part.size, file.size, "fetching"
            self.room(file.size - part.size)
            self.fetcher.fetch(part)
            self.room(0)  # the folder may have disappeared since
            job.phase = "checking"
            part.sync()
            if sha256_of(part.path, job.check) != self._sum_on_board(file):
                discard(folder, file.name)
                raise ChangedError(
                    f"the copy of {file.name} does not have the checksum that the vehicle computed"
                )
            os.replace(part.path, free_path(folder / name))
            discard(folder, file.name)
            sync_folder(folder)
        except OSError as error:
            raise StorageError(f"cannot write into {folder}: {error.strerror}") from error
        finally:
            part.close()
        return False

    def _sum_on_board(self, file: VehicleFile) -> bytes:
        """Return the checksum that the vehicle computes, which takes a while."""
        for _ in range(CHECKSUM_REQUESTS):
            self.job.check()
            now, digest = self.files.sha256(file.name)
            if now.identity != file.identity:
                raise ChangedError(f"{file.name} has changed on board")
            if digest:
                return digest
            self.wait(SUM_PAUSE)
        raise StorageError(f"the vehicle did not finish the checksum of {file.name}")


def _linked(copy: Path, place: Path) -> bool:
    """Give a log a second name; return False when it is on another disk."""
    try:
        os.link(copy, place)
    except OSError:
        return False
    return True


def free_path(place: Path) -> Path:
    """Return `place`, or with `_2`, `_3`, … when another log has that name: logs are never
    replaced.
    """
    found, number = place, 1
    while found.exists():
        number += 1
        found = place.with_name(f"{place.stem}_{number}{place.suffix}")
    return found


def sha256_of(path: Path, check: Callable[[], None] = lambda: None) -> bytes:
    """Return the SHA-256 of a file. Raises StorageError, and what `check` raises between two
    blocks.
    """
    digest = hashlib.sha256()
    with os_errors(lambda why: f"cannot read {path}: {why}"), path.open("rb") as stream:
        while block := stream.read(BLOCK):
            digest.update(block)
            check()
    return digest.digest()
