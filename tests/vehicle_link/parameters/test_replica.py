"""A replica detects when changes alone no longer keep it correct."""

from __future__ import annotations

import pytest

from vehicle_link.parameters.replica import MISSED, ParameterReplica

KP, KV, LAYOUT = "control.kp", "control.kv", "station.bearings.layout"


@pytest.fixture
def later(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return a list whose number, set by the test, is the seconds that have passed."""
    now = [0.0]
    monkeypatch.setattr("vehicle_link.parameters.replica.monotonic", lambda: 100.0 + now[0])
    return now


@pytest.fixture
def replica() -> ParameterReplica:
    """Return the replica of process 1 of a vehicle, read at revision 3."""
    made = ParameterReplica()
    made.note_status(1, 3)
    made.load({KP: 4.0, KV: 3.0, LAYOUT: "paper"}, 3, 1)
    return made


def test_the_first_snapshot_is_due_when_a_vehicle_is_seen() -> None:
    replica = ParameterReplica({KP: 9.0})
    assert (replica.is_due, replica.in_step) == (False, False)
    replica.note_status(1, 0)
    assert (replica.is_due, replica.in_step) == (True, False)
    snapshot = replica.load({KP: 4.0}, 0, 1)
    assert (replica.is_due, replica.in_step) == (False, True)
    assert (snapshot.before, snapshot.values) == ({KP: 9.0}, {KP: 4.0})
    assert snapshot.instance_before is None


def test_a_change_that_was_received_needs_no_snapshot(
    replica: ParameterReplica, later: list[float]
) -> None:
    assert replica.apply({KP: 5.0}, 4, 1) == {KP: 5.0}
    replica.note_status(1, 4)
    later[0] = 10 * MISSED
    assert (replica.in_step, replica.is_due, replica.value(KP)) == (True, False, 5.0)


def test_a_status_may_overtake_its_change(replica: ParameterReplica, later: list[float]) -> None:
    replica.note_status(1, 4)
    later[0] = 0.9 * MISSED
    replica.note_status(1, 4)
    assert (replica.in_step, replica.is_due) == (False, False)
    replica.apply({KP: 5.0}, 4, 1)
    later[0] = 10 * MISSED
    replica.note_status(1, 4)
    assert (replica.in_step, replica.is_due) == (True, False)


def test_a_change_that_was_missed_needs_a_snapshot(
    replica: ParameterReplica, later: list[float]
) -> None:
    replica.note_status(1, 4)
    later[0] = 1.1 * MISSED
    assert replica.is_due
    snapshot = replica.load({KP: 4.0, KV: 9.0}, 4, 1)
    assert (snapshot.before[KV], snapshot.values[KV]) == (3.0, 9.0)
    assert (replica.in_step, replica.is_due) == (True, False)


def test_a_newer_change_does_not_hide_one_that_was_missed(
    replica: ParameterReplica, later: list[float]
) -> None:
    replica.apply({KP: 5.0}, 5, 1)
    replica.note_status(1, 5)
    assert (replica.in_step, replica.is_due) == (False, False)
    later[0] = 1.1 * MISSED
    assert replica.is_due
    replica.load({KP: 5.0, KV: 9.0}, 5, 1)
    assert (replica.in_step, replica.is_due, replica.value(KV)) == (True, False, 9.0)


def test_changes_may_overtake_each_other(replica: ParameterReplica, later: list[float]) -> None:
    replica.apply({KP: 5.0}, 6, 1)
    replica.apply({KV: 9.0}, 4, 1)
    replica.apply({KP: 4.5}, 5, 1)
    replica.note_status(1, 6)
    later[0] = 10 * MISSED
    assert (replica.in_step, replica.is_due) == (True, False)
    assert (replica.value(KP), replica.value(KV)) == (5.0, 9.0)


def test_another_process_needs_a_snapshot_at_once(replica: ParameterReplica) -> None:
    replica.apply({KP: 5.0}, 40, 1)
    replica.note_status(2, 0)
    assert (replica.in_step, replica.is_due) == (False, True)
    snapshot = replica.load({KP: 4.0, KV: 3.0}, 0, 2)
    assert (snapshot.instance_before, snapshot.instance) == (1, 2)
    assert replica.apply({KP: 6.0}, 1, 2) == {KP: 6.0}
    assert replica.revision == 1


def test_a_change_of_a_new_process_outlives_the_snapshot_that_began_before_it(
    replica: ParameterReplica,
) -> None:
    replica.note_status(2, 1)
    since = replica.clock
    assert replica.apply({KV: 3.5}, 2, 2) == {KV: 3.5}
    replica.load({KP: 4.0, KV: 3.0}, 1, 2, since)
    assert (replica.value(KV), replica.revision) == (3.5, 2)


def test_after_a_lost_link_a_snapshot_is_due_though_nothing_is_known_to_be_missed(
    replica: ParameterReplica,
) -> None:
    replica.mark_incomplete()
    assert not replica.is_due, "the process that answers may be another than the one last shown"
    replica.note_status(1, 3)
    assert (replica.in_step, replica.is_due) == (True, True)
    replica.load({KP: 4.0, LAYOUT: "wide"}, 3, 1)
    assert not replica.is_due
    assert replica.value(LAYOUT) == "wide"


def test_revisions_of_an_unknown_station_do_not_outlive_a_lost_link(
    replica: ParameterReplica,
) -> None:
    replica.apply({LAYOUT: "wide"}, 30)
    replica.mark_incomplete()
    replica.load({LAYOUT: "paper"}, 3, 1)
    assert replica.apply({LAYOUT: "eight"}, 1) == {LAYOUT: "eight"}
