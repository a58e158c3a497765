"""Every change of a parameter is one row, in order, whatever its source and the outages."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.disk_worker import DiskWorker
from console.parameters.history import ParameterHistory
from console.parameters.history_writer import (
    AT_RESTART,
    AT_START,
    NOT_RECEIVED,
    ParameterHistoryWriter,
)
from console.parameters.presets import ParameterPresets
from console.parameters.store import StationStore
from quadrotor.errors import RefusedError, StorageError
from quadrotor.parameter_description import ParameterValue
from tests.waiting import until
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.parameters.replica import ParameterReplica

KP, KV, LAYOUT = "control.kp", "control.kv", "beacons.layout"
BOUND = 20.0
Row = tuple[str, ParameterValue, ParameterValue, str, str]


class Bench:
    """Witness on a data folder; `again` is another process on the same one."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.alarms: list[str | None] = []
        self.catalogue = Catalogue(data)
        self.history = ParameterHistory(self.catalogue.engine, "quad1")
        self.witness = ParameterHistoryWriter(self.history, self.alarms.append, DiskWorker("lists"))
        self.replica = ParameterReplica(self.history.known())
        self.stamp = 1_000

    def tell(
        self,
        name: str,
        old: Any,
        value: Any,
        revision: int,
        who: str = "anna",
        stamp: int = 0,
        instance: int = 1,
    ) -> None:
        self.stamp += 1
        stamp = stamp or self.stamp
        change = ParameterChange(stamp, name, old, value, who, revision, instance)
        self.replica.apply({name: value}, revision, instance)
        self.witness.changed(change, self.stamp)

    def compare(self, values: dict[str, ParameterValue], version: tuple[int, int]) -> None:
        """Fetch a snapshot of process `version[0]` at revision `version[1]`."""
        instance, revision = version
        self.witness.compare(self.replica.load(values, revision, instance))

    def rows(self, **wanted: Any) -> list[Row]:
        """Return the rows, oldest first."""
        assert until(lambda: self.witness._worker.is_idle)
        found = reversed(self.history.changes(**wanted))
        return [(c.name, c.old, c.new, c.requester, c.flight) for c in found]

    def again(self) -> Bench:
        self.close()
        return Bench(self.data)

    def close(self) -> None:
        self.witness.close()
        self.catalogue.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[], Bench]]:
    made: list[Bench] = []

    def make() -> Bench:
        made.append(made[-1].again() if made else Bench(tmp_path))
        return made[-1]

    yield make
    made[-1].close()


def test_changes_of_everybody_are_rows_in_order_with_types_kept(start: Callable[[], Bench]) -> None:
    bench = start()
    bench.tell(KP, 4.0, 5.0, 1)
    bench.tell("station.bearings.noisy", False, True, 1, "ben")
    bench.tell(KP, 5.0, 6, 2, "ros2 param")
    bench.tell(LAYOUT, "paper", "1 0 0 0; 'x' \"y\"", 3)
    expected = [
        (KP, 4.0, 5.0, "anna", ""),
        ("station.bearings.noisy", False, True, "ben", ""),
        (KP, 5.0, 6, "ros2 param", ""),
        (LAYOUT, "paper", "1 0 0 0; 'x' \"y\"", "anna", ""),
    ]
    assert bench.rows() == expected
    assert bench.rows(name=KP) == [expected[0], expected[2]]
    assert start().rows() == expected, "they survive a restart"


def test_the_same_message_twice_is_one_row(start: Callable[[], Bench]) -> None:
    bench = start()
    for _ in range(2):
        bench.tell(KP, 4.0, 5.0, 1, stamp=77)
    assert len(bench.rows()) == 1


def test_a_page_of_the_history_ends_where_the_next_begins(start: Callable[[], Bench]) -> None:
    bench = start()
    for k in range(7):
        bench.tell(KP, float(k), float(k + 1), k + 1)
    assert until(lambda: bench.witness._worker.is_idle)
    first = bench.history.changes(limit=4)
    rest = bench.history.changes(limit=4, before=first[-1].id)
    assert [c.new for c in first + rest] == [7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0]


def test_a_flight_is_from_arming_to_disarming_and_remembers_what_was_before(
    start: Callable[[], Bench],
) -> None:
    bench = start()
    assert bench.history.flight() is None
    bench.tell(KP, 4.0, 5.0, 1)
    bench.witness.status(False, "")
    bench.witness.status(True, "run1")
    bench.tell(KP, 5.0, 6.0, 2)
    bench.tell(KP, 6.0, 7.0, 3)
    bench.tell(KV, 3.0, 3.5, 4)
    assert [row[-1] for row in bench.rows()] == ["", "run1", "run1", "run1"]
    flight = bench.history.flight()
    assert flight is not None
    assert (flight.run, flight.is_over, flight.values) == ("run1", False, {KP: 5.0, KV: 3.0})
    bench.witness.status(False, "run1")
    bench.tell(KV, 3.5, 4.0, 5)
    assert [row[2] for row in bench.rows(flight="")] == [5.0, 4.0]
    flight = bench.history.flight()
    assert flight is not None
    assert (flight.is_over, flight.values) == (True, {KP: 5.0, KV: 3.0})


def test_a_station_that_dies_in_flight_goes_on_with_the_same_flight(
    start: Callable[[], Bench],
) -> None:
    bench = start()
    bench.witness.status(True, "run1")
    bench.tell(KP, 4.0, 5.0, 1)
    bench = start()
    bench.witness.status(True, "run2")
    bench.tell(KP, 5.0, 6.0, 2)
    assert [row[-1] for row in bench.rows()] == ["run1", "run2"]
    flight = bench.history.flight()
    assert flight is not None
    assert flight.values == {KP: 4.0}


def test_what_was_not_heard_is_found_later(start: Callable[[], Bench]) -> None:
    bench = start()
    bench.compare({KP: 4.0, KV: 3.0}, (1, 0))
    bench.tell(KP, 4.0, 5.0, 1)
    bench.compare({KP: 5.0, KV: 9.0}, (1, 2))
    assert bench.rows()[1:] == [(KV, 3.0, 9.0, NOT_RECEIVED, "")]


def test_a_vehicle_that_starts_anew_takes_its_changes_back(start: Callable[[], Bench]) -> None:
    bench = start()
    bench.compare({KP: 4.0, KV: 3.0}, (1, 0))
    bench.tell(KP, 4.0, 5.0, 1)
    bench.tell(KV, 3.0, 3.5, 1, instance=2)
    bench.compare({KP: 4.0, KV: 3.5}, (2, 1))
    assert bench.rows() == [
        (KP, 4.0, 5.0, "anna", ""),
        (KV, 3.0, 3.5, "anna", ""),
        (KP, 5.0, 4.0, AT_RESTART, ""),
    ]


def test_a_change_whose_message_was_lost_is_a_row_as_well(start: Callable[[], Bench]) -> None:
    bench = start()
    bench.compare({KP: 4.0, KV: 3.0}, (1, 0))
    bench.tell(KP, 4.0, 5.0, 1)
    bench.tell(KP, 6.0, 7.0, 3)  # the second change's message was lost
    bench.tell(KP, 4.0, 5.0, 1)  # again, by another way: nothing is missing before it
    bench.tell(KP, 4.0, 4.5, 9, instance=2)  # from another process
    bench.tell(KP, 4.5, 4.6, 10, instance=2)
    assert until(lambda: bench.witness._worker.is_idle)
    rows = [(c.revision, c.old, c.new, c.requester) for c in reversed(bench.history.changes())]
    assert rows == [
        (1, 4.0, 5.0, "anna"),
        (2, 5.0, 6.0, NOT_RECEIVED),
        (3, 6.0, 7.0, "anna"),
        (1, 4.0, 5.0, "anna"),
        (9, 4.0, 4.5, "anna"),
        (10, 4.5, 4.6, "anna"),
    ]


def test_a_station_that_was_away_says_so(start: Callable[[], Bench]) -> None:
    start().compare({KP: 4.0}, (1, 0))
    bench = start()
    bench.witness.begin({"station.x": 1})
    bench.compare({KP: 7.0}, (1, 3))
    assert bench.rows() == [(KP, 4.0, 7.0, AT_START, "")]
    bench.compare({KP: 7.0}, (1, 3))
    assert len(bench.rows()) == 1


def test_a_database_that_fails_for_a_while_leaves_no_hole(
    start: Callable[[], Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = start()
    monkeypatch.setattr("console.parameters.history_writer.RETRY", 0.01)
    add, failures = bench.history.add, iter([StorageError("disk full")] * 3)

    def add_later(changes: Any) -> None:
        if (error := next(failures, None)) is not None:
            raise error
        add(changes)

    monkeypatch.setattr(bench.history, "add", add_later)
    bench.tell(KP, 4.0, 5.0, 1)
    bench.tell(KP, 5.0, 6.0, 2)
    assert [row[2] for row in bench.rows()] == [5.0, 6.0]
    assert bench.alarms[:4] == ["disk full", "disk full", "disk full", None]


def test_the_station_tells_of_its_changes_in_the_order_of_their_revisions() -> None:
    told: list[int] = []
    store = StationStore()
    store.subscribe(lambda *change: told.append(change[-1]))

    def pull(values: Sequence[float]) -> None:
        for value in values:
            store.change({"station.bearings.sigma": value}, "x")

    hands = [
        threading.Thread(target=pull, args=([1.0 + 0.01 * (2 * k + hand) for k in range(100)],))
        for hand in range(2)
    ]
    for hand in hands:
        hand.start()
    for hand in hands:
        hand.join(BOUND)
    assert told == list(range(1, 201))


def test_presets_are_kept_replaced_deleted_and_brought_back(tmp_path: Path) -> None:
    presets = ParameterPresets(Catalogue(tmp_path).engine, "quad1")
    calm = presets.save("calm", {KP: 2.0, "a": True, "b": "x"}, "anna")
    assert presets.get(calm.id).values == {KP: 2.0, "a": True, "b": "x"}
    with pytest.raises(RefusedError, match=r"'calm' of anna; replace it"):
        presets.save("calm", {KP: 3.0}, "ben")
    other = presets.save("calm", {KP: 3.0}, "ben", replaces=True)
    assert [(p.requester, p.values) for p in presets.all()] == [("ben", {KP: 3.0})]
    with pytest.raises(RefusedError, match="another preset 'calm'"):
        presets.restore(calm.id)
    presets.delete(other.id)
    assert presets.all() == []
    with pytest.raises(RefusedError, match="no preset"):
        presets.get(other.id)
    assert presets.restore(other.id) == other
    assert ParameterPresets(Catalogue(tmp_path).engine, "quad2").all() == []
