"""Service `calibrate`: applied and stored, both or neither."""

from __future__ import annotations

from typing import Any

import pytest

from quadrotor.calibration_record import CalibrationRecord, Quality, parse_record
from quadrotor.errors import MeasurementError, RefusedError, StorageError
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.calibration.store import CalibrationStore
from vehicle.comms.calibrations import ANSWER_BYTES, TYPE
from vehicle_link.parameters.change import ParameterChange
from vehicle_link.transport.idempotent import Idempotent, answering

NS = 1_780_000_000_000_000_000
VALUES: dict[str, ParameterValue] = {"model.motor_slope": 0.0127, "model.motor_offset": 14.5}
BEFORE = {"model.motor_slope": 0.0126403, "model.motor_offset": 14.267}


def proposal(values: dict[str, ParameterValue] = VALUES, **fields: Any) -> str:
    return CalibrationRecord(name="motor", values=values, **fields).model_dump_json()


# -------------------------------------------------------------------------------- store
def test_it_is_applied_kept_and_told(wired: Any) -> None:
    quality = (Quality(name="worst residual", value=0.1, unit="count", limit=0.2),)
    text = proposal(quality=quality, run_id="run_7", stamp_ns=5, previous={"model.mass": 9.0})
    (record,) = wired.call("store", text)
    assert wired.parameters(*VALUES) == VALUES
    assert (record.values, record.previous) == (VALUES, BEFORE)
    assert (record.stamp_ns, record.requester, record.quality) == (NS, "anna", quality)
    assert parse_record(wired.history.read_text()) == record
    assert {change.requester for change in changes(wired.lab)} <= {"anna"}
    ((level, line),) = wired.said
    assert level == mailbox.INFO
    assert line == (
        "calibration stored: motor of 2026-05-28 20:26 UTC by anna from run_7: "
        "model.motor_slope = 0.0127, model.motor_offset = 14.5"
    )


def changes(lab: Any) -> list[ParameterChange]:
    return [one for one in lab.stack.outbox if isinstance(one, ParameterChange)]


def test_steps_that_flight_would_not_allow_are_taken_on_the_ground(wired: Any) -> None:
    wired.call("store", proposal({"model.mass": 2.3}))
    assert wired.lab.parameter("model.mass") == 2.3


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not a calibration record: the text: Invalid JSON"),
        ('{"values": {}}', "not a calibration record: name: Field required"),
        ('{"name": "motor", "extra": 1}', "not a calibration record: extra: Extra inputs"),
        (proposal({"model.motor_slope": 0.0127, "model.motor_offset": 99.0}), "99 is out of bound"),
        (proposal({"model.motor_slope": 0.0127, "model.gone": 1.0}), "unknown parameter"),
        (proposal({"safety.battery_warning": 12.5}), "is not below"),
        ('{"name": "m", "values": {"model.mass": NaN}}', "not a finite number"),
        (proposal(conditions={"a": "b" * 40_000}), "bytes long, at most 32000"),
    ],
)
def test_what_cannot_be_taken_over_leaves_all_as_it_was(wired: Any, text: str, reason: str) -> None:
    assert reason in wired.refused("store", text)
    assert not wired.history.exists()


def test_with_motors_on_or_in_flight_it_is_refused(wired: Any) -> None:
    wired.lab.arm()
    assert "calibration not applied: motors are on; disarm first" in wired.refused(
        "store", proposal()
    )
    wired.lab.start("take_off", height=0.5)
    wired.lab.wait_until(lambda v: v.airborne, what="lift-off", timeout=5)
    assert "the vehicle is in flight; land and disarm first" in wired.refused("store", proposal())
    assert "gyroscope not calibrated: the vehicle is in flight" in wired.refused("gyroscope")


def test_a_full_disk_puts_the_values_back(wired: Any) -> None:
    wired.history.parent.mkdir()
    wired.history.symlink_to("/dev/full")
    reason = wired.refused("store", proposal(), StorageError)
    assert "No space left on device" in reason
    assert reason.endswith("the values before are in force again")
    assert wired.parameters(*VALUES) == BEFORE
    assert wired.said == []


def test_figures_that_no_file_can_hold_put_the_values_back(wired: Any) -> None:
    text = '{"name": "m", "values": {"model.mass": 1.4}, "figures": [{"name": "f", "value": NaN}]}'
    assert "figures.0.value" in wired.refused("store", text)
    assert wired.lab.parameter("model.mass") == 1.308


def test_values_that_cannot_be_put_back_are_told(
    wired: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(record: CalibrationRecord) -> None:
        wired.is_silent = True
        raise StorageError("calibration not stored: No space left on device")

    monkeypatch.setattr(wired.store, "append", full)
    with pytest.raises(StorageError, match=r"its values stay in force until the next start: .*did"):
        wired.call("store", proposal())
    assert [level for level, _ in wired.said] == [mailbox.ERROR]


def test_a_repeated_request_is_stored_once(wired: Any) -> None:
    handler = Idempotent(answering(TYPE, wired.service.answer))
    request = wired.request("store", proposal(), "r1")
    first, again = handler(request), handler(request)
    assert first.accepted
    assert list(first.records) == list(again.records)
    assert len(wired.history.read_bytes().splitlines()) == 1
    bad = handler(wired.request("store", "{", "r2"))
    assert not bad.accepted
    assert "Invalid JSON" in bad.reason


def test_a_record_read_back_is_the_one_that_was_stored(wired: Any) -> None:
    with pytest.raises(MeasurementError):
        parse_record("")
    (record,) = wired.call("store", proposal(warnings=("only force\nno speed ±",)))
    assert CalibrationStore(wired.data, lambda _: None).newest() == [record]


# -------------------------------------------------------------------------------- history
def test_the_history_is_newest_first_and_fits_one_answer(wired: Any) -> None:
    assert wired.call("history") == []
    for k in range(40):
        wired.store.append(CalibrationRecord(name="mass", stamp_ns=k, conditions={"a": "b" * 4000}))
    records = wired.call("history")
    assert [record.stamp_ns for record in records] == list(range(39, 39 - len(records), -1))
    size = len(records[0].model_dump_json()) + 1
    assert len(records) == ANSWER_BYTES // size


def test_an_action_that_is_none_is_refused(wired: Any) -> None:
    reason = wired.refused("forget", error=RefusedError)
    assert "'forget': use store, history, in_force or gyroscope" in reason
