"""The service `calibrate` measures the gyroscope's drift again; a log stores all calibrations."""

from __future__ import annotations

import json
import math
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadrotor.calibration_record import CalibrationRecord
from quadrotor.errors import LinkError, RefusedError
from vehicle import mailbox
from vehicle.calibration.store import AT_START, FOLDER
from vehicle.comms.calibrations import KEEPER
from vehicle.modes import Mode


# -------------------------------------------------------------------------------- gyroscope
def drift(lab: Any) -> list[float]:
    found: list[float] = np.degrees(lab.stack.imu_calibrator.gyroscope_bias_b).tolist()
    return found


def test_the_drift_is_found_anew_and_kept(wired: Any) -> None:
    lab = wired.lab
    true = drift(lab)
    lab.stack.imu_calibrator.set_gyroscope_bias(np.radians([3.0, -2.0, 1.0]))
    (record,) = wired.call("gyroscope")
    found = [figure.value for figure in record.figures]
    assert found == pytest.approx(drift(lab))
    assert found == pytest.approx(true, abs=0.3)  # 50 samples
    assert (record.name, record.requester, record.values) == ("gyroscope", "anna", {})
    assert record.conditions["samples"] == "50"
    deviation = {one.name: one for one in record.quality}["noise per sample (1σ)"]
    assert deviation.limit == pytest.approx(lab.stack.parameters.safety.gyro_deviation_max)
    assert wired.call("in_force") == [record]
    assert wired.call("history") == [], "nobody has accepted it yet"
    assert lab.mode is Mode.READY


@pytest.mark.parametrize(
    ("to", "reason"), [(3.0, "standard deviation "), (170.0, "the drift would change by ")]
)
def test_a_vehicle_that_is_moved_meanwhile_keeps_its_drift(
    wired: Any, to: float, reason: str
) -> None:
    lab, before = wired.lab, drift(wired.lab)
    lab._simulate({"simulator.held": "hand", "simulator.hand_yaw": 0.0})
    lab.wait(2.5)  # the vehicle is lifted
    lab._simulate({"simulator.hand_yaw": to})
    lab.wait(0.01)
    refusal = wired.refused("gyroscope", error=RefusedError)
    assert refusal.startswith(f"gyroscope not calibrated: {reason}")
    assert refusal.endswith("keep the vehicle still")
    assert drift(lab) == before
    assert lab.mode is Mode.READY
    assert "ready: the gyroscope bias is unchanged: gyroscope not calibrated" in lab.said


def test_it_can_be_accepted_while_it_is_in_use_and_no_other_can(wired: Any) -> None:
    (found,) = wired.call("gyroscope")
    wired.now_ns = found.stamp_ns + 10**9
    (accepted,) = wired.call(
        "store", found.model_copy(update={"run_id": "run_7"}).model_dump_json()
    )
    assert accepted.figures == found.figures
    assert wired.call("history") == wired.call("in_force") == [accepted]
    wired.lab.wait(0.5)
    wired.now_ns += 10**9
    wired.call("gyroscope")
    reason = wired.refused("store", found.model_dump_json(), RefusedError)
    assert "the vehicle does not use this drift" in reason
    assert "not use this drift" in wired.refused("store", '{"name": "gyroscope"}')


def test_while_it_is_being_found_nothing_else_begins(wired: Any) -> None:
    lab = wired.lab
    assert lab.ask(mailbox.CalibrateGyroscope("g", "anna")).accepted
    lab.advance()
    for refused in (
        lab.ask(mailbox.CalibrateGyroscope("h", "bert")),
        lab.ask(mailbox.Arm("a", "")),
    ):
        assert not refused.accepted
        assert "the gyroscope is" in refused.reason
    assert "the gyroscope is being calibrated; wait" in wired.refused(
        "store", '{"name": "mass", "values": {"model.mass": 1.4}}'
    )


def test_motors_that_still_turn_refuse_it(wired: Any) -> None:
    lab = wired.lab
    lab.arm()
    assert "motors are on; disarm first" in wired.refused("gyroscope")
    lab.wait(0.2)
    assert lab.ask(mailbox.Disarm("d", "anna")).accepted
    assert lab.ask(mailbox.CalibrateGyroscope("g", "anna")).accepted
    lab.wait(0.1)  # the microcontroller's first report after it is still: on
    (outcome,) = lab.found
    assert "motors are on" in outcome.reason
    assert lab.mode is Mode.READY


def test_a_vehicle_that_gives_no_samples_ends_the_wait(wired: Any) -> None:
    wired.lab.wait = lambda seconds: None
    assert "found no drift within" in wired.refused("gyroscope", error=LinkError)


def test_what_is_found_at_the_start_is_kept_in_one_line(
    new_lab: Any, wire: Any, tmp_path: Path
) -> None:
    lab = new_lab().ready()
    wired = wire(lab, tmp_path)
    (found,) = lab.found
    assert (found.requester, found.request_id, found.reason) == ("start", "", "")
    wired.service.found(found)
    for thread in threading.enumerate():
        if thread.name == KEEPER:
            thread.join(10.0)
    (record,) = wired.store.newest_first()
    assert record.requester == "start"
    assert math.degrees(found.bias_b[0]) == pytest.approx(record.figures[0].value)
    assert (tmp_path / FOLDER / AT_START).exists()
    assert not wired.history.exists()


# -------------------------------------------------------------------------------- logs
def test_a_log_carries_those_in_force_and_no_others(lab: Any, wire: Any, tmp_path: Path) -> None:
    wired = wire(lab, tmp_path, refused=[3])
    for k, name in enumerate(("mass", "motor", "mass", "inertia")):
        wired.store.append(CalibrationRecord(name=name, stamp_ns=k + 1))
    carried = json.loads(wired.service.in_force_json())
    assert carried["problem"] == ""
    stamps = {name: record["stamp_ns"] for name, record in carried["in_force"].items()}
    assert stamps == {"motor": 2, "inertia": 4}
    assert [record.name for record in wired.call("in_force")] == ["motor", "inertia"]


def test_a_drift_of_an_earlier_start_is_not_in_force(lab: Any, wire: Any, tmp_path: Path) -> None:
    wired = wire(lab, tmp_path)
    wired.service._since_ns = 10
    wired.store.append(CalibrationRecord(name="gyroscope", stamp_ns=9))
    assert json.loads(wired.service.in_force_json())["in_force"] == {}
    wired.store.append(CalibrationRecord(name="gyroscope", stamp_ns=11))
    assert list(json.loads(wired.service.in_force_json())["in_force"]) == ["gyroscope"]


def test_500_samples_are_good_to_three_hundredths_of_a_degree_per_second(new_lab: Any) -> None:
    errors = []
    for seed in (3, 4, 5, 6):
        lab = new_lab(simulator__seed=seed, safety__gyro_samples=500)
        lab.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
        p = lab.stack.parameters.simulator
        true = (p.gyroscope_bias_x, p.gyroscope_bias_y, p.gyroscope_bias_z)
        errors.append(np.subtract(drift(lab), true))
    rms = np.sqrt(np.mean(np.square(errors)))
    print(f"rms error {rms:.4f} deg/s, worst {np.abs(errors).max():.4f}")
    assert rms <= 0.03


def test_a_steady_turn_at_the_start_is_no_drift(new_lab: Any) -> None:
    lab = new_lab(simulator__held="hand", simulator__hand_yaw=60.0)
    lab.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
    assert "gyroscope not calibrated: drift 60" in lab.said
    assert "°/s, allowed 40; keep the vehicle still" in lab.said
    assert drift(lab)[2] == pytest.approx(lab.stack.parameters.simulator.gyroscope_bias_z, abs=0.3)
