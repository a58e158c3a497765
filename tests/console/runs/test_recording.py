"""Conditions under which a run begins and ends."""

from __future__ import annotations

from console.runs.recording_rules import Decision, RecordingPolicy


def test_arming_starts_a_run_once() -> None:
    policy = RecordingPolicy()
    assert policy.status(False, False, 0.0) is Decision.NOTHING
    assert policy.status(True, False, 1.0) is Decision.START
    assert policy.status(True, False, 2.0) is Decision.NOTHING


def test_a_vehicle_already_armed_when_first_heard_is_recorded_at_once() -> None:
    assert RecordingPolicy().status(True, False, 0.0) is Decision.START


def test_a_run_goes_on_for_a_while_after_disarming() -> None:
    policy = RecordingPolicy()
    policy.status(True, False, 0.0)
    policy.status(False, False, 10.0)
    assert policy.tick(10.9, after_disarm=1.0) is Decision.NOTHING
    assert policy.tick(11.0, after_disarm=1.0) is Decision.STOP
    assert policy.tick(12.0, after_disarm=1.0) is Decision.NOTHING


def test_arming_again_before_the_end_calls_the_stop_off() -> None:
    policy = RecordingPolicy()
    policy.status(True, False, 0.0)
    policy.status(False, False, 10.0)
    assert (
        policy.status(True, False, 10.5) is Decision.START
    )  # refused by a recorder still recording
    assert policy.tick(11.5, after_disarm=1.0) is Decision.NOTHING


def test_a_status_that_stays_away_ends_nothing() -> None:
    policy = RecordingPolicy()
    policy.status(True, False, 0.0)
    assert policy.tick(1000.0, after_disarm=1.0) is Decision.NOTHING


def test_a_vehicle_that_starts_anew_in_flight_is_recorded_until_it_has_landed() -> None:
    policy = RecordingPolicy()
    policy.status(True, False, 0.0)
    assert policy.status(False, True, 10.0) is Decision.NOTHING  # its motors still turn
    assert policy.tick(15.0, after_disarm=1.0) is Decision.NOTHING
    policy.status(False, False, 20.0)
    assert policy.tick(20.9, after_disarm=1.0) is Decision.NOTHING
    assert policy.tick(21.0, after_disarm=1.0) is Decision.STOP


def test_a_calibration_on_the_ground_prolongs_no_run() -> None:
    policy = RecordingPolicy()
    policy.status(True, False, 0.0)
    policy.status(False, False, 10.0)
    policy.status(False, True, 10.5)
    assert policy.tick(11.0, after_disarm=1.0) is Decision.STOP
