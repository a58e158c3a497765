"""A board without motor access is commanded by rates, and what needs motors is refused."""

from __future__ import annotations

import pytest

from quadrotor.errors import OutOfBoundsError
from quadrotor.motor_state import MotorState
from quadrotor.vehicle_model import GRAVITY, VehicleModel, reference_of_thrust
from vehicle import mailbox
from vehicle.boards.board import BodyRates, CommandKind, RawSample, Traits
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.flight.stack import FlightStack
from vehicle.parameters import new_parameters
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.port import memory_port_pair

RATES = Traits("rated", (CommandKind.RATES,))
STILL, ONE_G = (512, 512, 512), (512, 512, 768)


def ready(board: Traits) -> FlightStack:
    parameters = new_parameters()
    parameters.safety.gyro_samples = 50
    stack = FlightStack(parameters, board=board)
    for k in range(1, 200):
        stamp_ns = k * 4_000_000
        stack.measure(mailbox.Heartbeat(stamp_ns))
        stack.tick(RawSample(stamp_ns, ONE_G, STILL, 16.0, 1e5, MotorState.OFF))
    return stack


def test_the_bench_is_refused_where_the_board_turns_no_single_motor() -> None:
    reply = ready(RATES).handle(mailbox.Bench("1", "anna", 1, 60, True))
    assert reply.reason == (
        "bench refused: board rated takes body rates and collective thrust, no motor references"
    )


def test_a_command_of_rates_carries_the_throttle_of_the_wanted_thrust() -> None:
    stack = ready(RATES)
    model = VehicleModel()
    stack._tick.wrench[:] = model.mass * GRAVITY, 0.0, 0.0, 0.0
    command = stack._make_command()
    assert isinstance(command, BodyRates)
    quarter = 0.25 * model.mass * GRAVITY
    hover = reference_of_thrust(quarter, model.motor_slope, model.motor_offset)
    assert command.throttle == pytest.approx(hover / 255.0)


def test_a_board_that_holds_angles_is_commanded_level_in_hover() -> None:
    stack = ready(Traits("level", (CommandKind.ANGLES, CommandKind.RATES)))
    model = VehicleModel()
    stack._tick.wrench[:] = model.mass * GRAVITY, 0.0, 0.0, 0.0
    command = stack._make_command()
    assert isinstance(command, AttitudeCommand)
    assert (command.roll, command.pitch) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert command.thrust_share == pytest.approx(1.0)


def test_the_mikrokopter_refuses_rates() -> None:
    near, _ = memory_port_pair()
    with pytest.raises(OutOfBoundsError, match="board mikrokopter takes motor references or roll"):
        Microcontroller([near], 0).command(BodyRates((0.0, 0.0, 0.0), 0.4))
