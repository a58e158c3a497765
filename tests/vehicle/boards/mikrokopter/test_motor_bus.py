"""A motor controller that does not answer is named by firmware, vehicle and refusal."""

from __future__ import annotations

import pytest

from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.parameters import FlightParameters
from quadrotor.constants import MOTORS
from quadrotor.errors import RefusedError
from quadrotor.motor_state import MotorState
from vehicle.boards.mikrokopter.motor_bus import NO_ANSWER, PERIOD_S, REFERENCES, MotorBus
from vehicle.modes import Mode
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial.commands import decode_instruction
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import Id

REST = (0, 0, 0, 0)


class Silent:
    def __getattr__(self, _: str):  # type: ignore[no-untyped-def]
        return lambda *_: None


def flight(missing: int) -> SimulatedFlight:
    parameters = FlightParameters().model_copy(deep=True)
    parameters.simulator.missing_motor = missing
    robot = SimulatedVehicle(parameters.simulator)
    out = SimulatedFlight(parameters, robot, Silent())  # type: ignore[arg-type]
    out.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
    out.wait(0.5)
    return out


def test_all_four_are_asked_for_in_turn() -> None:
    bus = MotorBus()
    asked = []
    for k in range(8):
        frame = bus.question(k * PERIOD_S, REST)
        assert frame is not None
        assert bus.question(k * PERIOD_S + 0.5 * PERIOD_S, REST) is None
        (found,) = FrameDecoder().feed(frame)
        instruction = decode_instruction(found)
        assert instruction is not None
        assert instruction.references == REST
        asked.append(instruction.id)
    assert asked[:4] == asked[4:]
    assert sorted(asked[:4]) == list(REFERENCES)


def test_a_change_is_one_line_and_its_end_another() -> None:
    bus = MotorBus()
    assert bus.receive(Id.MOTOR_REFERENCE_1, 0) is None
    line = bus.receive(Id.MOTOR_REFERENCE_2, NO_ANSWER)
    assert line is not None
    assert "no answer from the controller of motor left on the motors' bus" in line
    assert bus.receive(Id.MOTOR_REFERENCE_2, NO_ANSWER) is None
    line = bus.receive(Id.MOTOR_REFERENCE_4, NO_ANSWER)
    assert line is not None
    assert "controllers of motors left and right" in line
    assert bus.receive(Id.BATTERY, NO_ANSWER) is None
    bus.receive(Id.MOTOR_REFERENCE_2, 0)
    line = bus.receive(Id.MOTOR_REFERENCE_4, 12)
    assert line is not None
    assert "answer again" in line
    assert bus.missing == ()


@pytest.mark.parametrize("motor", [1, 2, 3, 4])
def test_arming_is_refused_with_the_motors_name(motor: int) -> None:
    one = flight(motor)
    name = MOTORS[motor - 1]
    with pytest.raises(
        RefusedError,
        match=f"not armed: no answer from the controller of motor {name} on the motors' bus; check",
    ):
        one.arm()
    assert one.stack.mode is Mode.READY


def test_it_arms_once_the_controller_answers_and_asks_no_more_while_motors_turn() -> None:
    one = flight(3)
    robot = one._simulated
    robot.configure(one.parameters.simulator.model_copy(update={"missing_motor": 0}))
    one.wait(0.5)
    one.arm()
    one.wait(0.5)
    assert robot.firmware.motor_state is MotorState.ON
    asked = []
    firmware = robot.firmware
    assert isinstance(firmware, Firmware)
    obey = firmware._obey

    def spy(instruction):  # type: ignore[no-untyped-def]
        asked.append(instruction.id)
        return obey(instruction)

    firmware._obey = spy  # type: ignore[method-assign]
    one.wait(0.5)
    assert asked
    assert not set(asked) & set(REFERENCES)


def test_one_lost_between_question_and_arming_is_named_when_the_motors_do_not_start() -> None:
    one = flight(0)
    one._simulated.configure(one.parameters.simulator.model_copy(update={"missing_motor": 2}))
    one.arm()
    texts: list[str] = []
    one._log.event = lambda event: texts.append(event.text)  # type: ignore[method-assign]
    one.wait(2.0)
    assert one.stack.mode is Mode.CUT
    assert "microcontroller reports motors init: no answer from the controller of motor left" in (
        "\n".join(texts)
    )
