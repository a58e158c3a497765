"""A run's two logs merged: all ticks, once, in order, exact, and the two logs unchanged."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

import mcap.reader
import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from flight_log import LogMessage, read_attachments, read_log, read_metadata, summarize
from flight_log.check import check_log
from flight_log.file import LogFile
from flight_log.merge import merge
from flight_log.run import read_run
from flight_log.run_folder import MERGED, STATION, VEHICLE, log_of, run_bytes
from flight_log.tick_columns import TICK_TOPICS
from flight_log.vehicle_messages import Comparison
from flight_log.writer import FILLED_METADATA, LogWriter
from tests.flight_log.drop_outs import OFFSET_NS, START_NS, Flight, flown, with_holes
from vehicle_link.messages import definition
from vehicle_link.topics.status import encode_batteries, encode_event


def run_of(folder: Path, flight: Flight, heard: frozenset[int] = frozenset()) -> Path:
    """Return the folder of a run with both logs."""
    run = folder / "run"
    flight.record(run / STATION, heard)
    flight.log_onboard(run / VEHICLE)
    return run


def stamps_of(run: Path, topic: str) -> list[int]:
    return [m.publish_ns for m in read_log(run, [f"/quad1/{topic}"])]


def events(count: int) -> list[tuple[str, bytes, int]]:
    found = []
    for k in range(count):
        stamp = START_NS + 37_000_000 * k
        found.append(("events", encode_event(stamp, 20, f"event {k}", "quad1"), stamp))
        found.append(("battery", encode_batteries(flown(1, k, stamp), "quad1")[0], stamp))
    return found


@pytest.mark.parametrize("seed", range(5))
def test_every_tick_of_the_vehicle_is_in_the_merged_run_once_in_order_and_exact(
    tmp_path: Path, seed: int
) -> None:
    print("seed", seed)
    count = 400
    flight = Flight(flown(count, seed), with_holes(count, seed), events(30))
    run = run_of(tmp_path, flight, frozenset(range(0, 60, 3)))
    logs = {path.name: path.read_bytes() for path in run.iterdir()}
    before = list(read_log(run))
    found = merge(run)
    after = list(read_log(run))
    truth = {(m.topic, m.publish_ns): m.payload for m in read_log(run / VEHICLE)}
    for topic in TICK_TOPICS:
        its = [m for m in after if m.topic == f"/quad1/{topic}"]
        assert [m.publish_ns for m in its] == flight.stamps.tolist()
        assert [m.payload for m in its] == [truth[m.topic, m.publish_ns] for m in its]
    for topic in ("events", "battery"):
        stamps = stamps_of(run, topic)
        assert stamps == sorted(stamp for name, _, stamp in flight.others if name == topic)
    assert (np.diff([m.log_ns for m in after]) >= 0).all()
    assert not (Counter(_known(before)) - Counter(_known(after))), "a message was lost"
    assert check_log(run).problems == []
    assert "parameters.json" in read_attachments(run)
    assert read_metadata(run)["quadlab.run"]["operator"] == "ada"
    assert read_metadata(run)[FILLED_METADATA]["files"] == f'["{STATION}", "{VEHICLE}"]'
    assert found.messages == summarize(run).message_count == len(after)
    assert {name: (run / name).read_bytes() for name in logs} == logs, "a log was changed"
    merged = log_of(run).read_bytes()
    assert merge(run) == found
    assert log_of(run).read_bytes() == merged, "the same logs gave other bytes"
    assert run_bytes(run) == sum(map(len, logs.values())) + len(merged)


def _known(messages: list[LogMessage]) -> list[tuple[str, int]]:
    """Return what identifies a message in both logs."""
    return [(m.topic, m.publish_ns) for m in messages]


def test_other_readers_read_the_merged_log(tmp_path: Path) -> None:
    flight = Flight(flown(400), with_holes(400, 2), events(10))
    run = run_of(tmp_path, flight)
    merge(run)
    own = [(m.topic, m.log_ns, m.publish_ns, m.payload) for m in read_log(run)]
    with (run / MERGED).open("rb") as stream:
        reader = mcap.reader.make_reader(stream, validate_crcs=True)
        found = [
            (channel.topic, message.log_time, message.publish_time, message.data)
            for _, channel, message in reader.iter_messages()
        ]
        summary = reader.get_summary()
    assert sorted(found) == sorted(own)
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(own)
    with AnyReader([run / MERGED]) as bag:
        stored = [(one.topic, time, bytes(data)) for one, time, data in bag.messages()]
    assert sorted(stored) == sorted((topic, log_ns, data) for topic, log_ns, _, data in own)


def test_ticks_that_stand_in_two_files_on_board_are_merged_once(tmp_path: Path) -> None:
    ticks, heard = flown(400), with_holes(400, 3)
    run = tmp_path / "run"
    Flight(ticks, heard).record(run / STATION)
    Flight(ticks[:220], heard[:220]).log_onboard(run / VEHICLE)
    Flight(ticks[205:], heard[205:]).log_onboard(run / "vehicle_2.mcap")
    assert merge(run).problems == []
    assert stamps_of(run, "imu") == ticks["imu"]["stamp_ns"].tolist()


def test_receptions_are_told_by_the_station_s_clock(tmp_path: Path) -> None:
    run = run_of(tmp_path, Flight(flown(400), with_holes(400, 5)))
    merge(run)
    for m in read_log(run, [f"/quad1/{topic}" for topic in TICK_TOPICS]):
        assert 0 <= m.log_ns + OFFSET_NS - m.publish_ns < 20_000_000


def test_of_a_log_that_began_long_before_the_run_only_the_run_is_taken(tmp_path: Path) -> None:
    flight = Flight(flown(3000), np.ones(3000, np.bool_))
    run = tmp_path / "run"
    Flight(flight.ticks[1500:], flight.heard[1500:]).record(run / STATION)
    flight.log_onboard(run / VEHICLE)
    merge(run)
    assert abs(stamps_of(run, "state")[0] - int(flight.stamps[1500])) < 20_000_000
    run = tmp_path / "cut by two seconds at most"
    Flight(flight.ticks[500:], flight.heard[500:]).record(run / STATION)
    flight.log_onboard(run / VEHICLE)
    merge(run)
    assert stamps_of(run, "state") == flight.stamps.tolist()


def test_a_tick_that_the_vehicle_s_log_lacks_stays_as_it_was_received(tmp_path: Path) -> None:
    ticks = flown(1000)
    flight = Flight(ticks, np.ones(1000, np.bool_))
    run = tmp_path / "run"
    flight.record(run / STATION)
    there = np.ones(1000, np.bool_)
    there[400:450] = False
    Flight(ticks[there], flight.heard[there]).log_onboard(run / VEHICLE)
    merge(run)
    assert stamps_of(run, "reference") == flight.stamps.tolist()
    assert check_log(run).problems == []


# ---------------------------------------------------------------- what is wrong with a folder
def spoiled(run: Path, what: str) -> Comparison:
    """Merge a run with one flaw, which has to be reported in one line."""
    found = merge(run)
    assert len(found.problems) == 1, found.problems
    assert what in found.problems[0]
    return found


def test_a_torn_log_of_the_vehicle_is_read_up_to_its_tear(tmp_path: Path) -> None:
    heard = np.ones(1000, np.bool_)
    heard[200:800] = False
    flight = Flight(flown(1000), heard)
    run = run_of(tmp_path, flight)
    data = (run / VEHICLE).read_bytes()
    (run / VEHICLE).write_bytes(data[: len(data) // 2])
    found = spoiled(run, f"{VEHICLE} ends")
    assert 0.0 < found.filled < 1.2
    assert found.missing > 0.0
    assert set(flight.stamps[heard].tolist()) <= set(stamps_of(run, "imu"))


def test_a_damaged_chunk_on_board_is_told_and_the_rest_is_taken(tmp_path: Path) -> None:
    heard = np.ones(1000, np.bool_)
    heard[200:800] = False
    run = run_of(tmp_path, Flight(flown(1000), heard))
    data = bytearray((run / VEHICLE).read_bytes())
    middle = len(data) // 3
    data[middle : middle + 40] = bytes(40)
    (run / VEHICLE).write_bytes(data)
    found = spoiled(run, "1 damaged chunks")
    assert found.why == "the vehicle's log of it is damaged"
    assert found.filled + found.missing == pytest.approx(1.2, abs=0.01)


@pytest.mark.parametrize("which", ["vehicle", "time"])
def test_a_log_of_another_run_is_left_out(tmp_path: Path, which: str) -> None:
    flight = Flight(flown(400), with_holes(400, 3))
    run = tmp_path / "run"
    flight.record(run / STATION)
    if which == "time":
        Flight(flown(400, start_ns=START_NS + 10**12), flight.heard).log_onboard(run / VEHICLE)
    else:
        facts = {"vehicle": "quad2", "recorder": "onboard"}
        with LogWriter(run / VEHICLE, facts, {}) as log:
            for m in read_log(run / STATION):
                log.write(m.topic, m.type_name, m.payload, m.log_ns, m.publish_ns)
    recorded = list(read_log(run / STATION))
    found = spoiled(run, f"{VEHICLE} {'is of quad2' if which == 'vehicle' else 'has no tick'}")
    assert found.messages == 0
    assert list(read_log(run)) == recorded


def test_a_vehicle_s_log_of_an_older_version_is_merged_with_the_fields_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flight = Flight(flown(400), with_holes(400, 3))
    run = run_of(tmp_path, flight)
    now = list(read_log(run / VEHICLE))
    (run / VEHICLE).unlink()
    whole = definition("quadlab_msgs/Actuators")
    older = whole.replace("float64 scaling\n", "")
    assert older != whole
    with monkeypatch.context() as before, LogWriter(run / VEHICLE, {"vehicle": "quad1"}, {}) as log:
        before.setattr(
            "vehicle_link.messages.definition",
            lambda kind: older if kind.endswith("Actuators") else definition(kind),
        )
        for m in now:
            payload = m.payload[:-8] if m.topic.endswith("actuators") else m.payload
            log.write(m.topic, m.type_name, payload, m.log_ns, m.publish_ns)
    vehicle = (run / VEHICLE).read_bytes()
    found = merge(run)
    assert (found.missing, found.problems) == (0.0, [])
    assert (run / VEHICLE).read_bytes() == vehicle
    for topic in TICK_TOPICS:
        assert stamps_of(run, topic) == flight.stamps.tolist()
    actuators = read_run(run).topics["actuators"]
    motors = flight.ticks["actuators"]["motor_references"][:, 0].astype(np.float32)
    assert actuators.values("motor_references[0]").tolist() == motors.tolist()
    assert np.isnan(actuators.values("scaling")).all()


def test_a_merge_while_the_vehicle_s_log_is_still_coming_makes_nothing_and_spoils_nothing(
    tmp_path: Path,
) -> None:
    flight = Flight(flown(400), with_holes(400, 3))
    run = run_of(tmp_path, flight)
    part = run / "quad1_1.mcap.part"
    (run / VEHICLE).rename(part)
    whole = part.read_bytes()
    part.write_bytes(whole[:5000])
    found = merge(run)
    assert (found.messages, found.filled) == (0, 0.0)
    assert log_of(run).name == STATION
    assert sorted(path.name for path in run.iterdir()) == [part.name, STATION]
    assert part.read_bytes() == whole[:5000]
    part.write_bytes(whole)
    part.rename(run / VEHICLE)
    merge(run)
    assert stamps_of(run, "state") == flight.stamps.tolist()


def test_a_run_without_a_log_of_the_vehicle_is_the_station_s(tmp_path: Path) -> None:
    run = tmp_path / "run"
    Flight(flown(400), np.ones(400, np.bool_)).record(run / STATION)
    found = merge(run)
    assert found == Comparison(total=found.total, ticks=400)
    assert log_of(run).name == STATION
    assert log_of(tmp_path / "old.mcap") == tmp_path / "old.mcap"


@pytest.mark.parametrize("writes", [1, 3, 8, 20, 10_000])
def test_a_merge_that_is_killed_leaves_the_run_as_it_was_or_merged(
    tmp_path: Path, writes: int
) -> None:
    flight = Flight(flown(1500), with_holes(1500, 3), events(10))
    run = run_of(tmp_path, flight)
    child = os.fork()
    if child == 0:  # dies in the middle, without any clean-up
        left, real = [writes], LogFile.write

        def write(self: LogFile, data: bytes) -> int:
            left[0] -= 1
            if left[0] <= 0:
                os.write(self._fd, data[: len(data) // 2])
                os._exit(9)
            return real(self, data)

        LogFile.write = write  # type: ignore[method-assign]
        merge(run)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    is_killed = os.waitstatus_to_exitcode(status) == 9
    assert log_of(run).name == (STATION if is_killed else MERGED)
    merge(run)
    assert stamps_of(run, "imu") == flight.stamps.tolist()
    assert sorted(path.name for path in run.iterdir()) == [MERGED, STATION, VEHICLE]
