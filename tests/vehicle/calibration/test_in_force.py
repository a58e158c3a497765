"""Calibrations with which a vehicle starts, and its reports on the other stored ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.boards.kind import find_kind
from vehicle.calibration.in_force import start_values
from vehicle.calibration.store import FOLDER, HISTORY, CalibrationStore
from vehicle.processes.parent import _with_calibrations

NS = 1_780_000_000_000_000_000


def record(name: str, values: dict[str, ParameterValue], second: int = 0) -> CalibrationRecord:
    return CalibrationRecord(
        name=name, values=values, requester="anna", stamp_ns=NS + second * 10**9
    )


MASS = record("mass", {"model.mass": 1.4}, 1)
MOTOR = record("motor", {"model.motor_slope": 0.0127, "model.motor_offset": 14.0}, 2)


def test_their_values_are_started_with_and_told_in_one_line() -> None:
    found = start_values([MASS, MOTOR], {})
    assert found.values == MASS.values | MOTOR.values
    assert found.refused == []
    when = "2026-05-28 20:26 UTC by anna"
    assert found.lines == [(False, f"calibrations in force: mass of {when}, motor of {when}")]


def test_what_was_given_by_hand_wins_and_is_told() -> None:
    found = start_values([MASS, MOTOR], {"model.motor_offset": 15.5, "control.law": "geometric"})
    assert found.values["model.motor_offset"] == 15.5
    assert found.values["model.motor_slope"] == 0.0127
    assert found.values["control.law"] == "geometric"
    assert found.refused == []
    ((is_bad, line),) = found.lines
    assert not is_bad
    assert line.endswith(
        "motor of 2026-05-28 20:26 UTC by anna but for --set model.motor_offset=15.5"
    )


def test_one_that_all_was_given_against_is_not_in_force() -> None:
    found = start_values([MASS], {"model.mass": 1.3})
    assert found.values == {"model.mass": 1.3}
    assert found.refused == [MASS.stamp_ns]
    ((is_bad, line),) = found.lines
    assert not is_bad
    assert line.endswith("is not in force: --set model.mass=1.3")


def test_one_is_judged_with_the_values_of_the_board_that_is_flown() -> None:
    one_cell = record("battery", {"safety.battery_warning": 3.4})
    assert start_values([one_cell], {}).refused == [one_cell.stamp_ns]
    found = start_values([one_cell], {}, find_kind("crazyflie").traits.parameters)
    assert (found.values, found.refused) == (one_cell.values, [])


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"model.motor_slope": 0.0127, "model.motor_offset": 99.0}, "99 is out of bounds"),
        ({"model.motor_slope": float("nan")}, "not a finite number"),
        ({"model.motor_gone": 1.0}, "unknown parameter 'model.motor_gone'"),
        ({"model.motor_offset": "14"}, "must be a number"),
        ({"safety.battery_warning": 12.5}, "is not below"),
    ],
)
def test_one_that_the_parameters_no_longer_allow_is_refused_whole_and_the_others_kept(
    values: dict[str, ParameterValue], reason: str
) -> None:
    bad = record("motor", values, 5)
    found = start_values([MASS, bad], {})
    assert found.values == MASS.values
    assert found.refused == [bad.stamp_ns]
    assert [is_bad for is_bad, _ in found.lines] == [True, False]
    line = found.lines[0][1]
    assert line.startswith("calibration motor of 2026-05-28 20:26 UTC by anna is not in force: ")
    assert reason in line
    assert line.endswith("; calibrate again")


def test_a_bad_value_is_not_hidden_by_one_given_by_hand() -> None:
    bad = record("motor", {"model.motor_offset": 99.0})
    found = start_values([bad], {"model.motor_offset": 15.0})
    assert found.refused == [NS]
    assert found.values == {"model.motor_offset": 15.0}


def test_the_gyroscopes_drift_of_another_start_says_nothing() -> None:
    found = start_values([record("gyroscope", {})], {})
    assert (found.values, found.lines) == ({}, [])


def test_a_vehicle_starts_with_what_its_folder_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _with_calibrations(tmp_path, {"model.mass": 1.2}, "mikrokopter") == (
        {"model.mass": 1.2},
        [],
        [],
    )
    store = CalibrationStore(tmp_path, lambda _: None)
    bad = record("inertia", {"model.inertia_xx": 7.0}, 3)
    for one in (MASS, MOTOR, bad):
        store.append(one)
    history = tmp_path / FOLDER / HISTORY
    history.write_bytes(history.read_bytes() + b'{"na')
    values, refused, notices = _with_calibrations(tmp_path, {"model.mass": 1.2}, "mikrokopter")
    assert values == {"model.mass": 1.2} | MOTOR.values
    assert refused == [MASS.stamp_ns, bad.stamp_ns]
    levels = [mailbox.WARN, mailbox.INFO, mailbox.WARN, mailbox.INFO]
    assert [level for level, _ in notices] == levels
    printed = capsys.readouterr().err.splitlines()
    # After the name of the vehicle, which another test may have given to this process.
    assert [line.partition(": ")[2] for line in printed] == [text for _, text in notices]
    assert "moved to set_aside.jsonl" in printed[0]
    assert (
        "mass of 2026-05-28 20:26 UTC by anna is not in force: --set model.mass=1.2" in printed[1]
    )
    assert "inertia_xx = 7 is out of bounds" in printed[2]
    assert "calibrations in force: motor of" in printed[3]
