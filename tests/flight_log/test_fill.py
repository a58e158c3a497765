"""Filling a run from the vehicle's log: all ticks, once, in order, and nothing else changed."""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flight_log import read_attachments, read_log, read_metadata
from flight_log.blocks import BlockReader
from flight_log.check import check_log
from flight_log.file import LogFile
from flight_log.fill import write_filled
from flight_log.fill_source import FillSource
from flight_log.filling import Filling, Placed
from flight_log.index import channel_counts
from flight_log.run_index import RunIndex, index_run
from flight_log.tick_columns import TICK_TOPICS
from flight_log.writer import FILLED_METADATA
from quadrotor.errors import StorageError
from tests.flight_log.drop_outs import OFFSET_NS, START_NS, VEHICLE, Flight, flown, with_holes
from vehicle_link import topics

ALL = (0, 2**62)
CHUNK = 6
RECORD = struct.Struct("<BQ")


def source_of(path: Path) -> FillSource:
    """The whole file."""
    names = {}
    reader = BlockReader(path)
    for _ in reader:
        pass
    for number, channel in reader.channels.items():
        names[number] = (channel.topic, reader.schemas[channel.schema_id].name)
    data, place = path.read_bytes(), 8
    while data[place] != CHUNK:  # behind what is attached
        place += RECORD.size + int(RECORD.unpack_from(data, place)[1])
    return FillSource(path.name, path, ((place, len(data)),), names)


def filled(run: Path, onboard: Path, span: tuple[int, int] = ALL) -> RunIndex:
    index = index_run(run)
    write_filled(run, index, Filling(index, [source_of(onboard)], *span), {"messages": "1"})
    return index


def events(count: int) -> list[tuple[str, bytes, int]]:
    found = []
    for k in range(count):
        stamp = START_NS + 37_000_000 * k
        found.append(("events", topics.encode_event(stamp, 20, f"event {k}", "quad1"), stamp))
        found.append(("battery", topics.encode_batteries(flown(1, k, stamp), VEHICLE)[0], stamp))
    return found


@pytest.mark.parametrize("seed", range(5))
def test_every_tick_of_the_vehicle_is_in_the_filled_run_once_and_in_order(
    tmp_path: Path, seed: int
) -> None:
    print("seed", seed)
    count = 400
    flight = Flight(flown(count, seed), with_holes(count, seed), events(30))
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run, frozenset(range(0, 60, 3)))
    before = list(read_log(run))
    filled(run, onboard)
    after = list(read_log(run))
    truth = {(m.topic, m.publish_ns): m.payload for m in read_log(onboard)}
    had = {(m.topic, m.publish_ns) for m in before}
    for topic in TICK_TOPICS:
        its = [m for m in after if m.topic == f"/quad1/{topic}"]
        assert [m.publish_ns for m in its] == flight.stamps.tolist()
        receptions = np.diff([m.log_ns for m in its])
        assert (receptions >= 0).all()
        for m in its:
            if (m.topic, m.publish_ns) not in had:
                assert m.payload == truth[m.topic, m.publish_ns]
    for topic in ("events", "battery"):
        stamps = [m.publish_ns for m in after if m.topic == f"/quad1/{topic}"]
        assert stamps == sorted(stamp for name, _, stamp in flight.others if name == topic)
    assert not (Counter(_known(before)) - Counter(_known(after))), "a message was lost"
    assert check_log(run).problems == []
    assert "parameters.json" in read_attachments(run)
    assert read_metadata(run)["quadlab.run"]["operator"] == "ada"
    assert read_metadata(run)[FILLED_METADATA] == {"messages": "1"}


def _known(messages: list) -> list[tuple]:  # type: ignore[type-arg]
    return [(m.topic, m.type_name, m.payload, m.log_ns, m.publish_ns) for m in messages]


def test_filling_twice_adds_nothing(tmp_path: Path) -> None:
    flight = Flight(flown(400), with_holes(400, 3), events(10))
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    filled(run, onboard)
    first = _known(list(read_log(run)))
    index = index_run(run)
    filling = Filling(index, [source_of(onboard)], *ALL)
    assert (filling.look().messages, filling.look().ticks) == (0, 0)
    assert write_filled(run, index, filling, {}) == 0
    assert _known(list(read_log(run))) == first
    assert index.holes() == []


def test_ticks_that_stand_in_two_files_on_board_are_filled_in_once(tmp_path: Path) -> None:
    ticks, heard = flown(400), with_holes(400, 3)
    run, first, second = (tmp_path / f"{name}.mcap" for name in ("run", "first", "second"))
    Flight(ticks, heard).record(run)
    Flight(ticks[:220], heard[:220]).log_onboard(first)
    Flight(ticks[205:], heard[205:]).log_onboard(second)
    index = index_run(run)
    sources = [source_of(first), source_of(second)]
    write_filled(run, index, Filling(index, sources, *ALL), {})
    its = [m.publish_ns for m in read_log(run, ["/quad1/imu"])]
    assert its == ticks["imu"]["stamp_ns"].tolist()


def test_receptions_are_told_by_the_station_s_clock(tmp_path: Path) -> None:
    flight = Flight(flown(400), with_holes(400, 5))
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    filled(run, onboard)
    for m in read_log(run, [f"/quad1/{topic}" for topic in TICK_TOPICS]):
        assert 0 <= m.log_ns + OFFSET_NS - m.publish_ns < 20_000_000


def test_nothing_outside_of_the_span_is_filled_in(tmp_path: Path) -> None:
    heard = np.zeros(400, np.bool_)
    heard[100:200] = heard[250:300] = True
    flight = Flight(flown(400), heard)
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    span = (int(flight.stamps[90]), int(flight.stamps[310]))
    filled(run, onboard, span)
    assert index_run(run).ticks.tolist() == flight.stamps[90:311].tolist()


def test_a_run_that_was_deleted_or_changed_meanwhile_is_not_brought_back(tmp_path: Path) -> None:
    flight = Flight(flown(200), with_holes(200, 2))
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    index = index_run(run)
    filling = Filling(index, [source_of(onboard)], *ALL)
    moved = tmp_path / "trash.mcap"

    real = filling.placed

    def placed() -> Iterator[Placed]:
        yield from real()
        run.rename(moved)

    filling.placed = placed  # type: ignore[method-assign]
    before = run.read_bytes()
    with pytest.raises(StorageError, match="not filled"):
        write_filled(run, index, filling, {})
    assert not run.exists()
    assert moved.read_bytes() == before
    assert list(tmp_path.glob("*.filling")) == []


def test_a_damaged_chunk_on_board_is_told_and_the_rest_is_taken(tmp_path: Path) -> None:
    heard = np.ones(1000, np.bool_)
    heard[200:800] = False
    flight = Flight(flown(1000), heard)
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    data = bytearray(onboard.read_bytes())
    middle = len(data) // 3
    data[middle : middle + 40] = bytes(40)
    onboard.write_bytes(data)
    index = index_run(run)
    found = Filling(index, [source_of(onboard)], *ALL).look()
    assert len(found.damaged) == 1
    assert 0 < found.ticks < 600
    assert found.holes


def test_the_end_of_a_log_tells_how_many_messages_it_has(tmp_path: Path) -> None:
    path = tmp_path / "onboard.mcap"
    Flight(flown(333), np.ones(333, np.bool_)).log_onboard(path)
    data, asked = path.read_bytes(), []

    def read(place: int, length: int) -> bytes:
        asked.append(length)
        return data[place : place + length]

    counts = channel_counts(read, len(data))
    assert sorted(counts.values()) == [333] * 4
    assert sum(asked) < 2800


@pytest.mark.parametrize("writes", [1, 3, 8, 20, 10_000])
def test_a_writer_that_is_killed_leaves_the_run_as_it_was_or_filled(
    tmp_path: Path, writes: int
) -> None:
    flight = Flight(flown(1500), with_holes(1500, 3), events(10))
    run, onboard = tmp_path / "run.mcap", tmp_path / "onboard.mcap"
    flight.log_onboard(onboard)
    flight.record(run)
    before = run.read_bytes()
    child = os.fork()
    if child == 0:  # dies in the middle of it, without any tidying
        left, real = [writes], LogFile.write

        def write(self: LogFile, data: bytes) -> int:
            left[0] -= 1
            if left[0] <= 0:
                os.write(self._fd, data[: len(data) // 2])
                os._exit(9)
            return real(self, data)

        LogFile.write = write  # type: ignore[method-assign]
        filled(run, onboard)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.waitstatus_to_exitcode(status) == 9:
        assert run.read_bytes() == before
        assert len(list(tmp_path.glob("*.filling"))) == 1
    filled(run, onboard)
    assert index_run(run).ticks.tolist() == flight.stamps.tolist()
    assert list(tmp_path.glob("*.filling")) == []
