"""The transfers from the vehicle, one at a time: service `transfer`, topic `transfers`.

They include each run's comparison with the vehicle's own log. Their own thread waits for vehicle
and disk. Pending work survives a restart of the station: a run that is not compared yet is marked
in the catalogue, a download by its part file.
"""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Callable

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, open_runs, store_completeness
from console.link.outbox import INFO, WARN
from console.parameters.station import RecorderParameters
from console.runs.adoption import update_entry
from console.transfers.download import Download
from console.transfers.fetcher import ChangedError, Fetcher, TransferRate
from console.transfers.job import CancelledError, Job, Kind, NotYetError
from console.transfers.part_file import (
    NoRoomError,
    discard,
    request_download,
    requested_downloads,
    withdraw_download,
)
from console.transfers.run_logs import complete_run, into_folder
from console.transfers.transfer_disk import TransferDisk
from console.transfers.vehicle_files import VehicleFiles, check_name
from flight_log.index import is_closed
from flight_log.run_folder import station_log
from quadrotor.errors import JobError, LinkError, QuadlabError, RefusedError, StorageError
from vehicle_link.messages import encode, header, new
from vehicle_link.transport.heartbeat import LinkState

log = logging.getLogger(__name__)

ONBOARD = "onboard"
SHOWN = 5.0
"""Seconds for which a finished transfer is still reported."""
RETRY_PERIOD = 1.0
"""Seconds between two checks of a condition that is waited for."""
MOST_CRASHES = 3
"""Number of processes of a comparison that may be killed before it waits for the next start."""
MAX_TRIES = 600
"""Number of tries after which a run is compared only at the next start."""
ROOM_EVERY = 64
"""Number of pieces between two checks of the disk."""


class TransferQueue:
    """Queue of transfers and the thread that works on it; thread-safe. `start` begins the work.

    Args:
        files: of the vehicle.
        link_state: returns the state of the link to it.
        say: publishes an event (level, line).
    """

    def __init__(
        self,
        catalogue: Catalogue,
        vehicle: str,
        files: VehicleFiles,
        link_state: Callable[[], LinkState],
        parameters: RecorderParameters,
        say: Callable[[int, str], None],
    ) -> None:
        self._catalogue, self._vehicle, self._files = catalogue, vehicle, files
        self._link_state, self._parameters, self._say = link_state, parameters, say
        self.folder = catalogue.folder.parent / ONBOARD / vehicle
        self._disk = TransferDisk(self.folder, catalogue, parameters)
        self._jobs: list[Job] = []
        self._ids = itertools.count(1)
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._closing = threading.Event()
        self._pieces = 0
        self._thread = threading.Thread(target=self._run, name="transfers", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """End the work; a transfer in progress continues at the next start from where it is."""
        self._closing.set()
        self._wake.set()
        if self._thread.ident is not None:
            self._thread.join(5.0)

    # ------------------------------------------------------------------ any thread
    def run_closed(self, run_id: str) -> None:
        """Request the back-fill of a run that has ended."""
        if self._parameters.backfill:
            self.ask("backfill", run_id)

    def ask(self, kind: Kind, name: str, by_person: bool = False) -> int:
        """Request a transfer and return its number; one in progress is not begun twice.

        Raises RefusedError or StorageError.
        """
        if kind == "download":
            check_name(name)
            self._disk.make_folder()
            request_download(self.folder, name)
        elif by_person:
            self._catalogue.resolve(name)
            if (whose := self._catalogue.get(name).vehicle) != self._vehicle:
                raise RefusedError(f"run {name} is of {whose}, not {self._vehicle}; ask its page")
            store_completeness(self._catalogue, name, Completeness("open"))
        with self._lock:
            same = [job for job in self._jobs if (job.kind, job.name) == (kind, name)]
            for job in same:
                if not job.is_over:
                    return job.id
                self._jobs.remove(job)
            job = Job(next(self._ids), kind, name, by_person)
            self._jobs.append(job)
        self._wake.set()
        return job.id

    def cancel(self, name: str) -> None:
        """Cancel a transfer. Raises RefusedError when none of that name is in progress."""
        with self._lock:
            found = [job for job in self._jobs if job.name == name and not job.is_over]
            for job in found:
                job.cancelled.set()
        if not found:
            raise RefusedError(f"no transfer of {name!r:.80} is in progress")
        self._wake.set()

    def jobs(self) -> list[Job]:
        """Return the jobs in progress or just ended."""
        now = time.monotonic()
        with self._lock:
            self._jobs = [j for j in self._jobs if not j.is_over or now - j.ended < SHOWN]
            return list(self._jobs)

    def message(self, stamp_ns: int) -> bytes | None:
        """Return the quadlab_msgs/Transfers; None when there is nothing to report."""
        jobs = self.jobs()
        if not jobs:
            return None
        transfers = [job.message() for job in jobs]
        return encode(new("quadlab_msgs/Transfers", header=header(stamp_ns), transfers=transfers))

    # ------------------------------------------------------------------ its own thread
    def _run(self) -> None:
        self._resume()
        while not self._closing.is_set():
            job = self._next()
            if job is None:
                self._wake.wait(RETRY_PERIOD)
                self._wake.clear()
                continue
            try:
                self._work(job)
            except Exception as error:  # the other jobs wait for this thread
                log.exception("transfers")
                job.end("failed", f"a defect, see the station's log: {error!r}")
            if not job.is_over:
                job.tries += 1
                if job.kind == "backfill" and job.tries >= MAX_TRIES:
                    job.end("failed", job.problem)
                self._closing.wait(RETRY_PERIOD)

    def _resume(self) -> None:
        try:
            for name in requested_downloads(self.folder):
                self.ask("download", name)
            if self._parameters.backfill:
                for run_id in open_runs(self._catalogue, self._vehicle):
                    self.ask("backfill", run_id)
        except (QuadlabError, OSError) as error:
            self._say(WARN, f"interrupted transfers were not resumed: {error}")

    def _next(self) -> Job | None:
        """Return the next job: cancelled ones first, then downloads, then the newest run; those
        that wait for something other than the link come last.
        """
        with self._lock:
            jobs = [job for job in self._jobs if not job.is_over]
        for job in jobs:
            if job.cancelled.is_set():
                return job
        if self._link_state() is LinkState.LOST:
            for job in jobs:
                job.phase, job.rate = "waiting", 0.0
                job.problem = "the link to the vehicle is lost; it continues when the link is back"
            return None
        jobs.sort(key=lambda job: job.name, reverse=True)
        jobs.sort(key=lambda job: (bool(job.problem), job.kind != "download"))
        return jobs[0] if jobs else None

    def _work(self, job: Job) -> None:
        fetcher = Fetcher(self._files, self._on_piece(job))
        try:
            job.check()
            try:
                self._disk.make_folder()
            except StorageError as error:
                raise NotYetError(f"{error}; it continues when the folder is back") from error
            if job.kind == "download":
                self._download(job, fetcher).by_name()
            else:
                self._backfill(job, fetcher)
        except CancelledError:
            self._cancelled(job)
        except ChangedError as error:
            self._set_waiting(job, f"{error}; starting over")
        except (NotYetError, LinkError) as error:
            self._set_waiting(job, str(error))
        except NoRoomError as error:
            self._set_waiting(job, f"{error}; it continues when there is room")
        except JobError as error:
            self._crashed(job, str(error))
        except QuadlabError as error:
            if self._closing.is_set():
                return
            if job.kind == "backfill":
                self._store_completeness(
                    job.name, Completeness("unknown", why=f"not compared: {error}")
                )
            else:
                withdraw_download(self.folder, job.name)
            job.end("failed", str(error))
            self._say(WARN, f"{job.kind} of {job.name} failed: {error}")
        else:
            if job.kind == "download":
                self._say(INFO, f"the vehicle's log {job.name} was downloaded")
        finally:
            fetcher.close()

    def _backfill(self, job: Job, fetcher: Fetcher) -> None:
        log = self._catalogue.resolve(job.name)
        if not is_closed(station_log(log)):
            raise NotYetError(f"the file of run {job.name} is not closed yet")
        if (folder := into_folder(log)) != log:
            self._catalogue.update(job.name, file=folder.name)

        def check() -> None:
            job.check()
            self._check_open()

        found = complete_run(folder, self._download(job, fetcher), check)
        update_entry(self._catalogue, folder)
        store_completeness(self._catalogue, job.name, found)
        if found.state == "missing":
            job.end("incomplete", found.line)
        else:
            job.end("done")
        if found.state != "complete" or job.asked:
            self._say(WARN if found.missing else INFO, f"run {job.name}: {found.line}")

    def _download(self, job: Job, fetcher: Fetcher) -> Download:
        return Download(job, self.folder, self._files, fetcher, self._disk.check_room, self._wait)

    def _crashed(self, job: Job, why: str) -> None:
        """Start over after a job's process was killed; the run stays open for the next start."""
        job.crashes += 1
        if self._closing.is_set():
            return
        if job.crashes < MOST_CRASHES:
            self._set_waiting(job, f"{why}; starting over")
            return
        job.end("failed", f"{why}; it is tried again at the station's next start")
        self._say(WARN, f"{job.kind} of {job.name} failed: {job.problem}")

    def _cancelled(self, job: Job) -> None:
        if job.kind == "backfill":
            for path in self._catalogue.resolve(job.name).glob("*.part*"):
                path.unlink(missing_ok=True)
            self._store_completeness(
                job.name, Completeness("unknown", why="the comparison was cancelled")
            )
        else:
            discard(self.folder, job.name)
        job.end("cancelled")

    def _store_completeness(self, run_id: str, found: Completeness) -> None:
        try:
            store_completeness(self._catalogue, run_id, found)
        except StorageError:
            log.debug("not kept", exc_info=True)

    def _set_waiting(self, job: Job, why: str) -> None:
        job.phase, job.problem, job.rate = "waiting", why, 0.0

    def _on_piece(self, job: Job) -> Callable[[int], None]:
        rate = TransferRate()

        def on_piece(count: int) -> None:
            job.bytes += count
            job.rate = rate.add(count)
            job.problem = ""
            job.check()
            self._check_open()
            self._pieces += 1
            if self._pieces % ROOM_EVERY == 0:
                self._disk.check_room(0)

        return on_piece

    def _wait(self, seconds: float) -> None:
        self._closing.wait(seconds)
        self._check_open()

    def _check_open(self) -> None:
        if self._closing.is_set():
            raise LinkError("the station is closing")
