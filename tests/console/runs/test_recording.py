"""Conditions under which a run begins and ends."""

from __future__ import annotations

from console.runs.recording_rules import Decision, RecordingPolicy


def test_arming_starts_a_run_once() -> None:
    policy = RecordingPolicy()
    assert policy.status(False, 0.0) is Decision.NOTHING
    assert policy.status(True, 1.0) is Decision.START
    assert policy.status(True, 2.0) is Decision.NOTHING


def test_a_vehicle_already_armed_when_first_heard_is_recorded_at_once() -> None:
    assert RecordingPolicy().status(True, 0.0) is Decision.START


def test_a_run_goes_on_for_a_while_after_disarming() -> None:
    policy = RecordingPolicy()
    policy.status(True, 0.0)
    policy.status(False, 10.0)
    assert policy.tick(10.9, after_disarm=1.0) is Decision.NOTHING
    assert policy.tick(11.0, after_disarm=1.0) is Decision.STOP
    assert policy.tick(12.0, after_disarm=1.0) is Decision.NOTHING


def test_arming_again_before_the_end_calls_the_stop_off() -> None:
    policy = RecordingPolicy()
    policy.status(True, 0.0)
    policy.status(False, 10.0)
    assert policy.status(True, 10.5) is Decision.START  # refused by a recorder still recording
    assert policy.tick(11.5, after_disarm=1.0) is Decision.NOTHING


def test_a_status_that_stays_away_ends_nothing() -> None:
    policy = RecordingPolicy()
    policy.status(True, 0.0)
    assert policy.tick(1000.0, after_disarm=1.0) is Decision.NOTHING
