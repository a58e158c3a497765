"""Back-fill: what a run lacks of the vehicle's own log is fetched and put into the run's file.

The station knows where ticks are missing from their stamps alone; only the chunks of the vehicle's
log that hold those stretches, and its first and last one, are fetched. The index at the end of that
log tells how many ticks it has: when the run has as many, it is complete. Should the numbers differ
after all, the whole log is fetched.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from console.catalogue.completeness import Completeness
from console.transfers.fetcher import Fetcher
from console.transfers.job import Job, NotYetError
from console.transfers.part_file import PartFile, Range
from console.transfers.process import fill, look
from console.transfers.source import EDGE_NS, Source, together
from console.transfers.vehicle_files import VehicleFile, VehicleFiles, why_open
from console.transfers.verdict import judged
from flight_log.index import channel_counts, is_closed
from quadrotor.errors import LogFormatError
from vehicle_link.jobs import run

LEAD_NS = 2_000_000_000
"""The vehicle's log may begin so long before the run: arming is heard of a little later."""
INDEX_TRIES = 50
INDEX_PAUSE = 0.1  # s


class Backfill:
    """One run.

    Args:
        before_ns: end of the vehicle's run before this one, ns of the station's clock.
        room: raises when so many more bytes do not fit on the disk.
        check: raises when it is to end.
        run: as vehicle_link.jobs.run.
    """

    def __init__(
        self,
        job: Job,
        log: Path,
        folder: Path,
        files: VehicleFiles,
        fetcher: Fetcher,
        room: Callable[[int], None],
        wait: Callable[[float], None],
        before_ns: int = 0,
        check: Callable[[], None] | None = None,
        run: Callable[..., dict[str, Any]] = run,
    ) -> None:
        self._job, self._log, self._folder = job, log, folder
        self._files, self._fetcher, self._room, self._wait = files, fetcher, room, wait
        self._before_ns = before_ns
        self._check = check or job.check
        self._run = run

    def __call__(self) -> Completeness:
        """Compare, fetch, fill; how complete the run is afterwards.

        Raises ChangedError, CancelledError, NotYetError, LinkError, RefusedError, LogFormatError
        or StorageError; what was fetched stays for the next time.
        """
        job, log = self._job, self._log
        if not is_closed(log):
            raise NotYetError(f"the file of run {log.stem} is not closed yet")
        job.phase = "checking"
        told = self._run(look, log, check=self._check)
        since = max(told["began_ns"] - LEAD_NS, self._before_ns - told["delay_ns"])
        until = max(told["last_ns"], told["ended_ns"])
        on_board = self._files.files()
        sources = self._sources(on_board, told, since, until)
        try:
            job.bytes = 0
            job.phase = "fetching"
            for source in sources:
                self._fetch(source)
            found = self._fill(sources, since, until)
            lacking = [source for source in sources if not _agrees(source, found)]
            if lacking:
                for source in lacking:
                    source.spans = [(source.file.start_ns - EDGE_NS, source.file.end_ns + EDGE_NS)]
                    self._fetch(source)
                found = self._fill(sources, since, until)
        except BaseException:
            for source in sources:
                source.part.close()
            raise
        for source in sources:
            source.part.remove()
        return judged(found, sources, on_board)

    def _sources(
        self, on_board: list[VehicleFile], told: dict[str, Any], since: int, until: int
    ) -> list[Source]:
        found: list[Source] = []
        for file in sorted(on_board, key=lambda one: one.start_ns):
            end = file.end_ns or until
            if not file.start_ns or file.start_ns > until or end < since:
                continue
            if not file.closed:
                raise NotYetError(why_open(self._files, file))
            first, last = max(since, file.start_ns - EDGE_NS), min(until, end + EDGE_NS)
            spans = [(first, first + 2 * EDGE_NS), (last - 2 * EDGE_NS, last)]
            holes = [tuple(hole) for hole in told["holes"]] if told["ticks"] else [(since, until)]
            if told["ticks"]:
                holes += [tuple(gap) for gap in told["gaps"]]
                holes += [(since, told["first_ns"]), (told["last_ns"], until)]
            spans += [(max(first, a), min(last, b)) for a, b in holes if a < last and b > first]
            part = PartFile(self._folder, file)
            is_whole = since <= file.start_ns - EDGE_NS / 10 and end <= until
            found.append(Source(file, part, together(spans)))
            if is_whole:
                found[-1].count = self._count(found[-1])
        torn = [file for file in on_board if not file.closed and not file.start_ns]
        if torn and not any(
            one.file.start_ns <= told["first_ns"] + EDGE_NS
            and one.file.end_ns >= told["last_ns"] - LEAD_NS
            for one in found
        ):
            for source in found:
                source.part.close()
            raise NotYetError(why_open(self._files, torn[0]))
        return found

    def _count(self, source: Source) -> int | None:
        """Return ticks of the file, by the index at its end."""
        size = source.file.size
        try:
            counts = channel_counts(
                lambda place, length: self._fetcher.read(source.part, place, length), size
            )
        except LogFormatError:
            return None
        stretch = self._files.index(source.file.name, source.file.start_ns, source.file.start_ns)
        states = [
            counts.get(number, 0)
            for number, (topic, _) in stretch.channels.items()
            if topic.endswith("/state")
        ]
        return sum(states) if states else None

    def _fetch(self, source: Source) -> None:
        ranges = []
        for first, last in source.spans:
            stretch = self._stretch(source.file.name, first, last)
            source.channels.update(stretch[1])
            if stretch[0][0] < stretch[0][1]:
                ranges.append(stretch[0])
        source.ranges = together(ranges, gap=0)
        lacking = sum(end - begin for r in source.ranges for begin, end in source.part.lacks(*r))
        self._job.total_bytes = self._job.bytes + lacking
        self._room(lacking + self._log.stat().st_size)
        self._job.phase = "fetching"
        self._fetcher.fetch(source.part, source.ranges)

    def _stretch(self, name: str, first: int, last: int) -> tuple[Range, dict[int, Any]]:
        for _ in range(INDEX_TRIES):
            self._check()
            found = self._files.index(name, first, last)
            if found.end:
                return (found.begin, found.end), found.channels
            self._wait(INDEX_PAUSE)
        raise NotYetError(f"{name} is still being written on board")

    def _fill(self, sources: list[Source], since: int, until: int) -> dict[str, Any]:
        """Fill twice: what is still missing is written into the file, and known only after
        looking.
        """
        job = (fill, self._log, [source.fetched for source in sources], since, until)
        self._job.phase = "checking"
        found = self._run(*job, check=self._check)
        if found["messages"] and all(_agrees(source, found) for source in sources):
            self._job.phase = "merging"
            came = judged(found, sources, [])
            still = {
                "missing_seconds": f"{came.missing:.3f}",
                "missing": came.why * bool(came.missing),
            }
            self._run(*job, still, check=self._check)
        return found


def _agrees(source: Source, found: dict[str, Any]) -> bool:
    """Return whether the run has as many ticks of the file as its index says, or all of it was
    looked at.
    """
    whole = (source.file.start_ns - EDGE_NS, source.file.end_ns + EDGE_NS)
    if source.count is None or source.spans == [whole]:
        return True
    its = [one for one in found["stretches"] if one["name"] == source.file.name]
    return bool(its) and its[0]["in_run"] >= source.count
