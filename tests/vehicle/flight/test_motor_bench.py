"""One motor on the bench: what turns, what ends it, and what is refused in the meantime."""

from __future__ import annotations

from typing import Any

import pytest

from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from tests.support.narrowing import now
from vehicle import mailbox
from vehicle.flight.motor_bench import REFERENCE_MAX
from vehicle.modes import LEGAL_MOVES, Mode


def refusal(reply: mailbox.Reply) -> str:
    assert not reply.accepted
    return reply.reason


def test_to_the_bench_leads_only_rest_and_from_it_only_rest_or_the_cut() -> None:
    assert LEGAL_MOVES[Mode.BENCH] == {Mode.READY, Mode.CUT}
    assert [mode for mode in Mode if Mode.BENCH in LEGAL_MOVES[mode]] == [Mode.READY]


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_that_motor_turns_and_no_other_until_motor_0(lab: Any, motor: int) -> None:
    lab.keep_turning(1.0, motor, 100)
    wanted = [100 if k == motor else 0 for k in range(1, 5)]
    assert list(lab.robot.firmware.references) == wanted
    assert lab.stack.record["actuators"]["motor_references"][0].tolist() == wanted
    speeds = lab.robot.rotor_speeds
    assert speeds[motor - 1] > 50.0
    assert sum(speeds) == pytest.approx(speeds[motor - 1])
    status = lab.stack.status
    assert (Mode(status["mode"][0]), bool(status["armed"][0])) == (Mode.BENCH, True)
    assert not lab.view().airborne
    assert lab.turn_motor(0).accepted
    lab.wait(0.1)
    assert lab.mode is Mode.READY
    assert lab.robot.firmware.motor_state is MotorState.OFF
    assert lab.robot.firmware.references == (0, 0, 0, 0)
    assert f"motor {motor} (" in lab.said


def test_the_reference_follows_what_is_asked_for(lab: Any) -> None:
    for reference in (30, 190, 60):
        lab.keep_turning(0.4, 1, reference)
        assert lab.robot.firmware.references == (reference, 0, 0, 0)


def test_not_asked_for_again_it_stops_within_the_timeout(lab: Any) -> None:
    lab.keep_turning(1.0)
    lab.wait(0.2)  # 0.4 s since the request
    assert lab.mode is Mode.BENCH
    lab.wait(0.15)
    assert now(lab).mode is Mode.READY
    assert lab.robot.firmware.references == (0, 0, 0, 0)
    assert "motor 2 (left) stopped: not requested again within 0.5 s" in lab.said


def test_a_flight_process_that_dies_stops_it_too(lab: Any) -> None:
    lab.keep_turning(1.0, 2, REFERENCE_MAX)
    for _ in range(150):  # 0.3 s without a command: safety.command_timeout is 0.25 s
        lab.robot.step()
    assert lab.robot.firmware.references == (0, 0, 0, 0)
    assert lab.robot.firmware.motor_state is MotorState.OFF


def test_unsecured_it_says_what_to_confirm(lab: Any) -> None:
    reason = refusal(lab.turn_motor(secured=False))
    assert "confirm first that the propellers are off or the vehicle is fixed" in reason
    assert lab.mode is Mode.READY


@pytest.mark.parametrize(
    ("motor", "reference", "reason"),
    [
        (5, 100, "there is no motor 5: 1 front, 2 left, 3 rear, 4 right; 0 ends the bench"),
        (1, 201, "reference 201 is out of bounds; allowed 0 to 200 counts"),
        (1, 255, "reference 255 is out of bounds"),
    ],
)
def test_a_motor_or_reference_that_cannot_be_is_refused(
    lab: Any, motor: int, reference: int, reason: str
) -> None:
    assert reason in refusal(lab.turn_motor(motor, reference))
    assert lab.mode is Mode.READY
    lab.keep_turning(0.2)
    assert reason in refusal(lab.turn_motor(motor, reference))
    assert lab.stack.bench.references == (0, 100, 0, 0), "and changes nothing"


def test_armed_in_flight_starting_and_cut_it_is_refused(new_lab: Any) -> None:
    lab = new_lab()
    lab.advance()
    assert "the gyroscope is being calibrated" in refusal(lab.turn_motor())
    lab.ready().arm()
    lab.wait(0.1)
    assert "motors are on; disarm first" in refusal(lab.turn_motor())
    lab.start("take_off", height=0.5)
    lab.wait_until(lambda v: v.airborne, what="lift-off", timeout=5)
    assert "the vehicle is in flight; land and disarm first" in refusal(lab.turn_motor())
    assert lab.mode is Mode.ARMED
    assert lab.ask(mailbox.Emergency("e", "anna", "cut")).accepted
    lab.wait(0.01)
    assert "bench refused" in refusal(lab.turn_motor())
    assert now(lab).mode is Mode.CUT


def test_meanwhile_everything_else_is_refused_and_says_why(lab: Any) -> None:
    lab.keep_turning(0.2)
    on_it = r"motor 2 \(left\) is on (the bench|it)"
    with pytest.raises(RefusedError, match=f"not armed: {on_it}"):
        lab.arm()
    with pytest.raises(RefusedError, match=f"take_off refused: {on_it}; end it, then arm"):
        lab.start("take_off", height=1.0)
    for command in (
        mailbox.Calibrate("c", "anna", {"model.mass": 1.4}),
        mailbox.CalibrateGyroscope("g", "anna"),
        mailbox.Bench("b", "anna", 3, 100, True),
    ):
        reason = refusal(lab.ask(command))
        assert "motor 2 (left) is on" in reason
        assert "(motor 0) first" in reason
    assert lab.stack.parameters.model.mass == 1.308
    assert lab.mode is Mode.BENCH


@pytest.mark.parametrize(
    ("command", "after"),
    [
        (mailbox.Disarm("d", "anna"), Mode.READY),
        (mailbox.Emergency("e", "anna", "land"), Mode.READY),
        (mailbox.Emergency("e", "anna", "cut"), Mode.CUT),
    ],
)
def test_disarm_and_both_emergencies_stop_it(
    lab: Any, command: mailbox.Command, after: Mode
) -> None:
    lab.keep_turning(0.4)
    assert lab.ask(command).accepted
    lab.wait(0.05)
    assert lab.mode is after
    assert lab.robot.firmware.references == (0, 0, 0, 0)


def test_ending_a_bench_that_is_none_is_no_fault(lab: Any) -> None:
    assert lab.turn_motor(0).accepted
    assert lab.mode is Mode.READY


def test_a_low_battery_refuses_it_and_a_spent_one_ends_it(lab: Any) -> None:
    lab.keep_turning(0.4)
    voltage = float(lab.stack.status["battery_voltage"][0])
    lab.stack.parameters.safety.battery_land = voltage + 0.3
    lab.keep_turning(0.8)
    for _ in range(4):
        lab.turn_motor()
        lab.wait(0.1)
    assert lab.mode is Mode.READY
    assert "motor 2 (left) stopped: battery at 1" in lab.said
    assert "bench refused: battery at 1" in refusal(lab.turn_motor())


def test_a_vehicle_that_turns_under_it_is_not_fixed(lab: Any) -> None:
    lab._simulate({"simulator.held": "hand", "simulator.hand_roll": 60.0})
    lab.wait(0.2)  # lifted, but hardly turned
    lab._simulate({"simulator.hand_roll": -60.0})
    assert lab.turn_motor().accepted
    for _ in range(10):
        lab.turn_motor()
        lab.wait(0.1)
    assert "motor 2 (left) stopped: the vehicle turned by 2" in lab.said
    assert "fix it" in lab.said


def test_the_emergency_of_the_microcontroller_ends_it(lab: Any) -> None:
    lab.keep_turning(0.4)
    lab.robot.firmware._enter(MotorState.EMERGENCY)
    lab.wait(0.05)
    assert lab.mode is Mode.READY
    assert lab.robot.firmware.motor_state is MotorState.OFF
    assert "motor 2 (left) stopped: the microcontroller" in lab.said


def test_motors_that_do_not_start_are_told(lab: Any) -> None:
    set_state = lab.robot.firmware._set_motor_state
    lab.robot.firmware._set_motor_state = lambda value: value != MotorState.ON and set_state(value)
    for _ in range(20):
        lab.turn_motor()
        lab.wait(0.1)
    assert "motor 2 (left) stopped: the microcontroller reports motors" in lab.said
