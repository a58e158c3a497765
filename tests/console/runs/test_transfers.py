"""Transfers from the vehicle's disk: interrupted ones continue, and the data is identical."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, completeness_of, store_completeness
from console.parameters.station import RecorderParameters
from console.runs.adoption import described
from console.transfers import transfer_disk
from console.transfers import transfer_queue as transfer_queue_module
from console.transfers.download import Download
from console.transfers.fetcher import ChangedError, Fetcher
from console.transfers.job import Job, NotYetError
from console.transfers.part_file import NoRoomError, PartFile
from console.transfers.run_logs import complete_run
from console.transfers.transfer_queue import TransferQueue
from console.transfers.vehicle_files import VehicleFiles
from flight_log import read_log, read_metadata, recover
from flight_log.run_folder import MERGED, STATION, VEHICLE, run_bytes
from flight_log.tick_columns import TICK_TOPICS
from flight_log.writer import FILLED_METADATA
from quadrotor.errors import LinkError, RefusedError, StorageError
from quadrotor.records import TICK
from tests.flight_log.drop_outs import START_NS, Flight, flown, with_holes
from tests.support.clients import FakeClient
from tests.support.transfers import new_transfers
from tests.waiting import free_port, until
from vehicle.onboard_log.files import OnboardFiles
from vehicle_link.messages import decode, new
from vehicle_link.topics.status import encode_estimators, encode_status
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.session import hub_session

PATIENCE = 60.0  # s, for a broken program only


class Link:
    """Node for its clients; the other end is the vehicle's own code over a real folder.

    Attributes:
        asked: number of pieces so far.
        cut_at: number of the first piece that is not answered, like all after it.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.files = OnboardFiles(folder, list)
        self.asked: list[tuple[int, int]] = []
        self.cut_at: int | None = None
        self.before_piece: Callable[[int], None] = lambda number: None

    def client(self, name: str, srv_type: str, **_: Any) -> Any:
        answer = getattr(self.files, name.removeprefix("onboard_"))
        return FakeClient(name, srv_type, partial(self._call, name, answer))

    def _call(self, name: str, answer: Callable[[Any], Any], request: Any) -> Any:
        if name == "onboard_part" and request.length:
            if self.cut_at is not None and len(self.asked) >= self.cut_at:
                raise LinkError("the link is cut")
            self.asked.append((int(request.offset), int(request.length)))
            self.before_piece(len(self.asked))
        try:
            return answer(request)
        except RefusedError as error:
            return new(f"{SERVICES[name]}_Response", accepted=False, reason=str(error))


@pytest.fixture
def link(tmp_path: Path) -> Link:
    return Link(tmp_path / "vehicle")


@pytest.fixture
def onboard(tmp_path: Path) -> Path:
    return tmp_path / "vehicle"


def in_process(function: Callable[..., Any], *arguments: Any, check: Any) -> Any:
    """Run a job as jobs.run does, without the second that a new interpreter takes."""
    return function(*arguments)


def download_of(link: Link, folder: Path, name: str = "flight.mcap") -> Download:
    files = VehicleFiles(link)  # type: ignore[arg-type]
    fetcher = Fetcher(files, lambda count: None)
    job = Job(1, "download", name)

    def wait(seconds: float) -> None:  # for the checksum, which the vehicle's thread computes
        threading.Event().wait(seconds)

    return Download(job, folder, files, fetcher, lambda count: None, wait)


def completed(run: Path, link: Link) -> Completeness:
    folder = run.parent / "onboard"
    return complete_run(run, download_of(link, folder), lambda: None, in_process)


def ticks_of(run: Path) -> list[list[int]]:
    return [[m.publish_ns for m in read_log(run, [f"/quad1/{t}"])] for t in TICK_TOPICS]


# ---------------------------------------------------------------- a part file
def random_file(folder: Path, size: int, seed: int = 1) -> bytes:
    """Write a file that the vehicle regards as a closed log with an index; return its bytes."""
    Flight(flown(size // 400, seed), np.ones(size // 400, np.bool_)).log_onboard(
        folder / "flight.mcap"
    )
    return (folder / "flight.mcap").read_bytes()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fetch_that_is_cut_off_anywhere_goes_on_with_what_is_lacking(
    tmp_path: Path, link: Link, onboard: Path, seed: int
) -> None:
    print("seed", seed)
    random = np.random.default_rng(seed)
    data = random_file(onboard, 60_000, seed)
    files = VehicleFiles(link)  # type: ignore[arg-type]
    file = files.files()[0]
    fetcher = Fetcher(files, lambda count: None)
    for _ in range(8):
        link.cut_at = len(link.asked) + int(random.integers(1, 4))
        part = PartFile(tmp_path / "here", file)
        with pytest.raises(LinkError):
            fetcher.fetch(part)
        kept = part.size
        part.close()
        # Killed in the middle of a piece, or before it was written to the disk.
        data_here = part.path.read_bytes()
        part.path.write_bytes(data_here[: max(0, kept - int(random.integers(0, 4000)))])
        assert PartFile(tmp_path / "here", file).size >= kept - 4000
    link.cut_at = None
    before = len(link.asked)
    part = PartFile(tmp_path / "here", file)
    lacking = file.size - part.size
    fetcher.fetch(part)
    assert sum(length for _, length in link.asked[before:]) == lacking
    assert part.path.read_bytes() == data


def test_what_came_and_has_not_the_vehicle_s_checksum_is_fetched_again(
    bench: Bench, onboard: Path, link: Link
) -> None:
    data = random_file(onboard, 40_000)
    link.cut_at = 4
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert until(lambda: "cut" in bench.queue.jobs()[0].problem)
    bench.queue.close()
    part = bench.queue.folder / "flight.mcap.part"
    spoiled = bytearray(part.read_bytes())
    spoiled[3000:3010] = bytes(10)  # the disk lost them
    part.write_bytes(spoiled)
    link.cut_at = None
    bench.queue = bench.new_queue()
    bench.queue.start()
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == data
    assert link.asked.count((2800, 2800)) == 2


def test_another_content_under_the_name_is_begun_again(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    random_file(onboard, 40_000)
    files = VehicleFiles(link)  # type: ignore[arg-type]

    def replaced(number: int) -> None:
        if number == 4:
            other = onboard / "other"
            other.mkdir()
            random_file(other, 50_000, 9)
            (other / "flight.mcap").replace(onboard / "flight.mcap")

    link.before_piece = replaced
    file = files.files()[0]
    part = PartFile(tmp_path / "here", file)
    fetcher = Fetcher(files, lambda count: None)
    with pytest.raises(ChangedError) as changed:
        fetcher.fetch(part)
    part.close()
    assert "has changed on board" in str(changed.value)
    part = PartFile(tmp_path / "here", files.files()[0])
    assert part.restarted
    fetcher.fetch(part)
    assert part.path.read_bytes() == (onboard / "flight.mcap").read_bytes()


# ---------------------------------------------------------------- back-fill
@pytest.mark.parametrize("seed", range(4))
def test_a_run_with_holes_has_every_tick_of_the_vehicle_s_own_log(
    tmp_path: Path, link: Link, onboard: Path, seed: int
) -> None:
    print("seed", seed)
    count = 2000
    flight = Flight(flown(count, seed), with_holes(count, seed, holes=2 if seed else 0))
    run = tmp_path / "runs" / "run"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    lacking = int((~flight.heard).sum())
    found = completed(run, link)
    assert ticks_of(run) == [flight.stamps.tolist()] * 4
    assert found.state == ("filled" if lacking else "complete")
    assert found.filled == pytest.approx(lacking * 0.002, rel=0.05)
    assert (run / VEHICLE).read_bytes() == (onboard / "flight.mcap").read_bytes()
    names = [MERGED, STATION, VEHICLE]
    assert sorted(path.name for path in run.iterdir()) == names, "something is left of the way"
    told = read_metadata(run)[FILLED_METADATA]
    assert float(told["seconds"]) == pytest.approx(found.filled, abs=0.001)
    assert (told["missing_seconds"], told["missing"]) == ("0.000", "")
    asked = len(link.asked)
    assert completed(run, link).line == found.line, "a second one changed something"
    assert len(link.asked) == asked, "what is there was fetched again"
    assert sorted(path.name for path in run.iterdir()) == names


def test_a_log_that_two_runs_share_is_fetched_once(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    flight = Flight(flown(2000), np.ones(2000, np.bool_))
    flight.log_onboard(onboard / "flight.mcap")
    runs = [tmp_path / "runs" / name for name in ("first", "second")]
    for run, part in zip(runs, (slice(0, 900), slice(900, 2000)), strict=True):
        Flight(flight.ticks[part], flight.heard[part]).record(run / STATION)
    completed(runs[0], link)
    asked = len(link.asked)
    completed(runs[1], link)
    assert len(link.asked) == asked
    assert [(run / VEHICLE).stat().st_nlink for run in runs] == [2, 2]


def test_other_topics_that_were_lost_between_ticks_that_came_are_filled_in_too(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    others = [
        ("estimator", encode_estimators(flown(1, k), "complementary")[0], START_NS + 20_000_000 * k)
        for k in range(200)
    ]
    flight = Flight(flown(2000), np.ones(2000, np.bool_), others)
    run = tmp_path / "runs" / "run"
    flight.log_onboard(onboard / "flight.mcap")
    lost = {40, 41, 90, 150}
    flight.record(run / STATION, frozenset(set(range(200)) - lost))
    found = completed(run, link)
    assert (found.state, found.filled) == ("complete", 0.0)
    assert [m.publish_ns for m in read_log(run, ["/quad1/estimator"])] == [o[2] for o in others]


def test_a_back_fill_that_is_cut_off_at_any_piece_comes_to_the_same_end(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    flight = Flight(flown(1000, 4), with_holes(1000, 4))
    run = tmp_path / "runs" / "run"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    before = (run / STATION).read_bytes()
    cuts = 0
    while True:
        link.cut_at = len(link.asked) + 3
        try:
            found = completed(run, link)
            break
        except LinkError:
            cuts += 1
            assert ticks_of(run) == [flight.stamps[flight.heard].tolist()] * 4
            assert not (run / VEHICLE).exists()
    assert cuts > 3
    assert (run / STATION).read_bytes() == before
    assert found.state == "filled"
    assert ticks_of(run) == [flight.stamps.tolist()] * 4


def test_what_the_vehicle_has_no_log_of_any_more_is_told_as_missing(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    heard = np.ones(1000, np.bool_)
    heard[300:500] = False
    flight = Flight(flown(1000), heard)
    run = tmp_path / "runs" / "run"
    flight.record(run / STATION)
    Flight(flown(100, 2, START_NS + 60_000_000_000), np.ones(100, np.bool_)).log_onboard(
        onboard / "later.mcap"
    )
    found = completed(run, link)
    assert found.line == "0.4 s missing of 2.0 s: the vehicle's log of it was overwritten"


def test_what_was_lost_after_disarming_is_no_flaw_of_a_flight(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    heard = np.ones(2000, np.bool_)
    heard[800:1800] = False  # the vehicle disarmed in the meantime, and logged no more
    ticks = flown(2000)
    status = np.zeros(1, TICK)
    status["imu"]["stamp_ns"] = ticks["imu"]["stamp_ns"][1900]
    for armed, words in ((False, "complete: "), (True, "1.6 s missing of 4.0 s: ")):
        status["status"]["armed"] = armed
        told = encode_status(status, "ready", "ground", ())
        run = tmp_path / "runs" / f"armed {armed}"
        log = onboard / "flight.mcap"
        log.unlink(missing_ok=True)
        Flight(ticks[:1000], heard[:1000]).log_onboard(log)
        others = [("status", told, int(status["imu"]["stamp_ns"][0]))]
        Flight(ticks, heard, others).record(run / STATION, frozenset({0}))
        found = completed(run, link)
        assert found.line.startswith(words)
        assert found.filled == pytest.approx(0.4, abs=0.01)


def test_ticks_that_flight_itself_left_out_are_not_missing(
    tmp_path: Path, link: Link, onboard: Path
) -> None:
    ticks = flown(1000)
    ticks = np.delete(ticks, slice(400, 450))
    flight = Flight(ticks, np.ones(950, np.bool_))
    run = tmp_path / "runs" / "run"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    found = completed(run, link)
    assert (found.state, found.missing, found.filled) == ("complete", 0.0, 0.0)


def test_a_torn_log_on_board_is_waited_for_until_it_is_mended(
    tmp_path: Path, link: Link, onboard: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = Flight(flown(1000), with_holes(1000, 6))
    run, log = tmp_path / "runs" / "run", onboard / "flight.mcap"
    flight.log_onboard(log)
    flight.record(run / STATION)
    log.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    when = "flight.mcap was torn, and is repaired once 500 MB are free"

    def torn(request: Any) -> None:
        raise RefusedError(when)

    with monkeypatch.context() as vehicle:
        vehicle.setattr(link.files, "part", torn)
        with pytest.raises(NotYetError) as told:
            completed(run, link)
        assert str(told.value) == when, "the vehicle knows it, and nobody else"
    recover(log)
    found = completed(run, link)
    kept = {m.publish_ns for m in read_log(log, ["/quad1/state"])}
    assert kept <= set(ticks_of(run)[0])
    assert found.state in ("missing", "filled", "complete")


# ---------------------------------------------------------------- the queue
class Bench:
    """A station's data folder, a vehicle's, and the queue between them."""

    def __init__(self, data: Path, link: Link) -> None:
        self.catalogue = Catalogue(data)
        self.parameters = RecorderParameters(keep_free=10.0)
        self.link, self.state = link, LinkState.GOOD
        self.lines: list[str] = []
        self.queue = self.new_queue()

    def new_queue(self, vehicle: str = "quad1") -> TransferQueue:
        return TransferQueue(
            self.catalogue,
            vehicle,
            VehicleFiles(self.link),  # type: ignore[arg-type]
            lambda: self.state,
            self.parameters,
            lambda level, line: self.lines.append(line),
        )

    def enter(self, run: Path) -> None:
        self.catalogue.add(described(run, None))
        store_completeness(self.catalogue, run.stem, Completeness("open"))


@pytest.fixture
def bench(tmp_path: Path, link: Link, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr(transfer_queue_module, "RETRY_PERIOD", 0.02)
    made = Bench(tmp_path / "data", link)
    yield made
    made.queue.close()


def ended(bench: Bench, name: str) -> Job:
    found = until(lambda: [job for job in bench.queue.jobs() if job.name == name and job.is_over])
    assert found, [(job.phase, job.problem) for job in bench.queue.jobs()]
    job: Job = found[0]
    return job


def test_a_download_is_the_vehicle_s_file_and_stands_in_the_vehicle_s_folder(
    bench: Bench, onboard: Path
) -> None:
    data = random_file(onboard, 40_000)
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap", by_person=True)
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == data
    assert [path.name for path in bench.queue.folder.iterdir()] == ["flight.mcap"]
    assert bench.queue.folder.name == "quad1"


def test_a_log_of_the_same_name_and_another_vehicle_replaces_nothing(
    bench: Bench, onboard: Path
) -> None:
    mine = bench.queue.folder / "flight.mcap"
    mine.parent.mkdir(parents=True)
    mine.write_bytes(b"another vehicle's")
    data = random_file(onboard, 40_000)
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert ended(bench, "flight.mcap").phase == "done"
    assert mine.read_bytes() == b"another vehicle's"
    assert mine.with_name("flight_2.mcap").read_bytes() == data


def test_a_download_goes_on_when_the_link_is_back_and_after_a_new_start(
    bench: Bench, onboard: Path, link: Link
) -> None:
    data = random_file(onboard, 60_000)
    link.cut_at = 6
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert until(lambda: "cut" in bench.queue.jobs()[0].problem)
    bench.queue.close()
    bench.queue = bench.new_queue()
    link.cut_at = len(link.asked) + 5
    bench.state = LinkState.LOST
    bench.queue.start()
    assert until(lambda: bench.queue.jobs() and "lost" in bench.queue.jobs()[0].problem)
    link.cut_at, bench.state = None, LinkState.GOOD
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == data
    lengths = sum(length for _, length in link.asked if length > 8)
    assert lengths < len(data) + 4 * 2800, "much was fetched twice"


def test_nothing_is_made_where_the_data_folder_is_away_and_it_goes_on_when_it_is_back(
    bench: Bench, onboard: Path, link: Link, tmp_path: Path
) -> None:
    log = random_file(onboard, 60_000)
    data, away = tmp_path / "data", tmp_path / "away"

    def unmount(number: int) -> None:
        if number == 5:
            data.rename(away)
            data.mkdir()  # the mount point without the disk

    link.before_piece = unmount
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    gone = f"catalogue.sqlite is gone from the data folder {data}"
    assert until(lambda: bench.queue.jobs()[0].problem.startswith(gone))
    [job] = bench.queue.jobs()
    assert job.phase == "waiting"
    assert job.problem.endswith("; it continues when the folder is back")
    with pytest.raises(StorageError, match=gone):
        bench.queue.ask("download", "other.mcap")
    assert list(data.iterdir()) == []
    data.rmdir()
    away.rename(data)
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == log


def test_a_download_that_had_to_wait_is_not_forgotten_when_the_station_stops(
    bench: Bench, onboard: Path
) -> None:
    data = random_file(onboard, 20_000)
    bench.state = LinkState.LOST
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    bench.queue.close()
    bench.state = LinkState.GOOD
    bench.queue = bench.new_queue()
    bench.queue.start()
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == data


def test_a_download_of_what_is_not_there_is_not_asked_for_again(bench: Bench) -> None:
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert ended(bench, "flight.mcap").phase == "failed"
    assert list(bench.queue.folder.iterdir()) == []


def test_a_full_disk_is_said_and_waited_for(
    bench: Bench, onboard: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = random_file(onboard, 40_000)
    free = [0]
    monkeypatch.setattr(transfer_disk, "free_bytes", lambda folder: free[0])
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert until(lambda: "delete or move runs" in bench.queue.jobs()[0].problem)
    assert bench.queue.jobs()[0].phase == "waiting"
    free[0] = 10**9
    assert ended(bench, "flight.mcap").phase == "done"
    assert (bench.queue.folder / "flight.mcap").read_bytes() == data


def test_no_room_for_a_piece_is_told_as_such(
    tmp_path: Path, link: Link, onboard: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    random_file(onboard, 40_000)
    part = PartFile(tmp_path / "here", VehicleFiles(link).files()[0])  # type: ignore[arg-type]

    def full(*_: Any) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.write", full)
    with pytest.raises(NoRoomError, match="No space"):
        part.put(b"x")


def test_a_file_that_is_gone_meanwhile_is_one_clear_line(
    bench: Bench, onboard: Path, link: Link
) -> None:
    random_file(onboard, 40_000)
    link.before_piece = lambda number: (onboard / "flight.mcap").unlink() if number == 4 else None
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    job = ended(bench, "flight.mcap")
    assert job.phase == "failed"
    assert "no onboard log 'flight.mcap'" in job.problem


def test_a_cancelled_download_leaves_nothing(bench: Bench, onboard: Path, link: Link) -> None:
    random_file(onboard, 60_000)
    link.before_piece = lambda n: bench.queue.cancel("flight.mcap") if n == 5 else None
    bench.queue.start()
    bench.queue.ask("download", "flight.mcap")
    assert ended(bench, "flight.mcap").phase == "cancelled"
    assert list(bench.queue.folder.iterdir()) == []
    with pytest.raises(RefusedError, match="no transfer of"):
        bench.queue.cancel("flight.mcap")


@pytest.mark.parametrize("name", ["../secret.mcap", "a/b.mcap", "", "x.txt", ".mcap"])
def test_a_name_that_is_no_log_s_is_refused(bench: Bench, name: str) -> None:
    with pytest.raises(RefusedError, match="is not the name of a log"):
        bench.queue.ask("download", name)


@pytest.mark.parametrize("kind", ["folder", "single file"])
def test_runs_are_completed_by_a_real_process_also_those_of_before_the_start(
    bench: Bench, onboard: Path, kind: str
) -> None:
    flight = Flight(flown(1000, 8), with_holes(1000, 8))
    folder = bench.catalogue.folder / "r1"
    run = folder if kind == "folder" else folder.with_suffix(".mcap")
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(folder / STATION if kind == "folder" else run)
    bench.enter(run)
    entered = bench.catalogue.get("r1")
    bench.queue.start()  # without a request
    assert ended(bench, "r1").phase == "done"
    assert bench.catalogue.resolve("r1") == folder.resolve()
    assert ticks_of(folder) == [flight.stamps.tolist()] * 4
    after = bench.catalogue.get("r1")
    assert after.messages - entered.messages == 4 * int((~flight.heard).sum())
    assert completeness_of(bench.catalogue, ["r1"])["r1"].state == "filled"
    assert after.bytes == run_bytes(folder)


def test_while_the_vehicle_s_log_comes_a_run_is_the_station_s_and_a_new_start_goes_on(
    bench: Bench, onboard: Path, link: Link
) -> None:
    flight = Flight(flown(1000, 8), with_holes(1000, 8))
    run = bench.catalogue.folder / "r1"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    bench.enter(run)
    link.cut_at = 20
    bench.queue.start()
    assert until(lambda: bench.queue.jobs() and "cut" in bench.queue.jobs()[0].problem)
    assert ticks_of(run) == [flight.stamps[flight.heard].tolist()] * 4
    bench.queue.close()
    link.cut_at = None
    bench.queue = bench.new_queue()
    bench.queue.start()
    assert ended(bench, "r1").phase == "done"
    assert ticks_of(run) == [flight.stamps.tolist()] * 4
    fetched = sum(length for _, length in link.asked)
    assert fetched < (onboard / "flight.mcap").stat().st_size + 16 * 2800, "fetched twice"


def kill_a_new_job(killed: set[int]) -> bool:
    """Kill a job's process of this process that is not among those killed, and add it to them."""
    for path in Path("/proc/self/task").glob("*/children"):
        for pid in map(int, path.read_text().split()):
            with contextlib.suppress(ProcessLookupError, FileNotFoundError):  # it has just ended
                words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
                if pid not in killed and b"vehicle_link.jobs" in words:
                    os.kill(pid, signal.SIGKILL)
                    killed.add(pid)
                    return True
    return False


def test_a_run_whose_comparison_is_killed_is_compared_after_all(
    bench: Bench, onboard: Path
) -> None:
    flight = Flight(flown(1000, 8), with_holes(1000, 8))
    run = bench.catalogue.folder / "r1"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    bench.enter(run)
    bench.queue.start()
    killed: set[int] = set()
    for _ in range(transfer_queue_module.MOST_CRASHES):
        assert until(lambda: kill_a_new_job(killed))
    job = ended(bench, "r1")
    assert (job.phase, "SIGKILL" in job.problem) == ("failed", True)
    assert completeness_of(bench.catalogue, ["r1"])["r1"].state == "open"
    bench.queue.close()
    bench.queue = bench.new_queue()
    bench.queue.start()
    assert until(lambda: kill_a_new_job(killed))  # once, which the same queue outlasts
    assert ended(bench, "r1").phase == "done"
    assert ticks_of(run) == [flight.stamps.tolist()] * 4
    assert completeness_of(bench.catalogue, ["r1"])["r1"].state == "filled"


def test_a_cancelled_run_keeps_nothing_of_the_vehicle_s_log(
    bench: Bench, onboard: Path, link: Link
) -> None:
    flight = Flight(flown(1000, 8), with_holes(1000, 8))
    run = bench.catalogue.folder / "r1"
    flight.log_onboard(onboard / "flight.mcap")
    flight.record(run / STATION)
    bench.enter(run)
    link.before_piece = lambda n: bench.queue.cancel("r1") if n == 5 else None
    bench.queue.start()
    assert ended(bench, "r1").phase == "cancelled"
    assert [path.name for path in run.iterdir()] == [STATION]


def test_over_the_link_the_service_fetches_and_the_topic_tells(
    tmp_path: Path, onboard: Path
) -> None:
    random_file(onboard, 40_000)
    port = free_port()
    hub = hub_session(port)
    sessions: list[Any] = [hub, loopback_session(port), loopback_session(port)]
    names = ("station", "vehicle", "page")
    nodes = [Node(one, "/quad1", name) for one, name in zip(sessions, names, strict=True)]
    station, vehicle, page = nodes
    OnboardFiles(onboard, list).serve(vehicle)
    catalogue = Catalogue(tmp_path / "data")
    transfers = new_transfers(station, catalogue)
    heard: list[Any] = []
    topic = TOPICS["transfers"]
    page.subscribe(
        topic.name,
        topic.type_name,
        lambda received: heard.extend(decode(received.payload, topic.type_name).transfers),
    )
    client = page.client("station/transfer", SERVICES["transfer"])
    assert client.wait(PATIENCE)
    kind = f"{SERVICES['transfer']}_Request"
    assert not client.call(new(kind, action="fly", name="x")).accepted
    files = page.client("station/onboard_files", SERVICES["onboard_files"])
    listed = files.call(new(f"{SERVICES['onboard_files']}_Request"), timeout=5.0)
    assert [one.name for one in listed.files] == ["flight.mcap"]
    answer = client.call(new(kind, request_id="a", action="download", name="flight.mcap"))
    assert answer.accepted, answer.reason

    def is_done_and_told() -> bool:
        transfers.tick(0)
        return any(one.phase == "done" for one in heard)

    assert until(is_done_and_told)
    assert heard[-1].bytes == heard[-1].total_bytes
    there = tmp_path / "data" / "onboard" / "quad1" / "flight.mcap"
    assert there.read_bytes() == (onboard / "flight.mcap").read_bytes()
    transfers.close()
    for node in nodes:
        node.close()
    for session in reversed(sessions):
        session.close()
    catalogue.close()
