"""Simulated firmware: what it obeys, echoes, refuses, and when it takes over."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from quadrotor.motor_state import MotorState
from tests.support.narrowing import now
from vehicle.simulator.firmware.firmware import (
    BATTERY_LAND,
    BATTERY_TIME_MS,
    COMMAND_TIMEOUT_MS,
    START_MS,
    Firmware,
)
from vehicle_link.serial import commands as c
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, FlightControlMode, Id

HOVER = (127, 127, 127, 127)
STOPPED = (0, 0, 0, 0)


def frames(data: bytes) -> list[Frame]:
    return FrameDecoder().feed(data)


def set_state(firmware: Firmware, state: int, references: tuple[int, ...] = STOPPED) -> int:
    """Request a motor state; return the state that is echoed."""
    (echo,) = frames(firmware.receive(0, c.encode_set(references, Id.MOTOR_STATE, state)))
    reply = c.decode_value(echo)
    assert reply is not None
    assert reply[0] == Id.MOTOR_STATE
    return reply[1]


def set_value(firmware: Firmware, id: Id, value: int, command: tuple[int, ...] = STOPPED) -> int:
    """Request a value; return the value that is echoed."""
    (echo,) = frames(firmware.receive(0, c.encode_set(command, id, value)))
    reply = c.decode_value(echo)
    assert reply is not None
    assert reply[0] == id
    return reply[1]


def running() -> Firmware:
    firmware = Firmware()
    firmware.registers[Id.BATTERY] = 150
    assert set_state(firmware, MotorState.ON) == MotorState.ON
    return firmware


def test_commands_count_only_while_the_motors_are_on() -> None:
    firmware = Firmware()
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.command == STOPPED
    set_state(firmware, MotorState.ON)
    firmware.receive(1, c.encode_command(HOVER))
    assert firmware.command == HOVER
    set_state(firmware, MotorState.OFF, HOVER)
    assert firmware.command == STOPPED
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.command == STOPPED


def test_every_frame_carries_the_command() -> None:
    for data in (
        c.encode_set(HOVER, Id.GAIN_P, 3),
        c.encode_request(HOVER, Id.BATTERY),
        c.encode_mirror(HOVER, MIRROR),
    ):
        firmware = running()
        firmware.receive(0, data)
        assert firmware.command == HOVER


def test_missing_commands_are_an_emergency_after_250_ms_which_ignores_commands() -> None:
    firmware = running()
    firmware.advance(1000)
    assert firmware.motor_state is MotorState.EMERGENCY
    firmware = running()
    firmware.advance(100)
    firmware.receive(0, c.encode_command(HOVER))
    firmware.advance(100 + COMMAND_TIMEOUT_MS)
    assert (firmware.motor_state, firmware.command) == (MotorState.ON, HOVER)
    firmware.advance(101 + COMMAND_TIMEOUT_MS)
    assert (firmware.motor_state, firmware.command) == (MotorState.EMERGENCY, STOPPED)
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.command == STOPPED


def test_with_motors_off_nothing_is_missed() -> None:
    firmware = Firmware()
    firmware.advance(100_000)
    assert firmware.motor_state is MotorState.INIT


def test_out_of_the_emergency_only_through_off() -> None:
    firmware = running()
    firmware.advance(1000)
    assert set_state(firmware, MotorState.ON, HOVER) == MotorState.EMERGENCY
    assert set_state(firmware, MotorState.OFF) == MotorState.OFF
    assert set_state(firmware, MotorState.ON) == MotorState.ON


@pytest.mark.parametrize("state", [-1, 4, 300, MotorState.INIT])
def test_states_that_cannot_be_set_are_answered_with_the_present_one(state: int) -> None:
    assert set_state(running(), state) == MotorState.ON


def test_the_emergency_can_be_asked_for_in_flight_only() -> None:
    assert set_state(Firmware(), MotorState.EMERGENCY) == MotorState.INIT
    assert set_state(running(), MotorState.EMERGENCY) == MotorState.EMERGENCY


def test_a_battery_at_its_end_for_a_second_is_an_emergency() -> None:
    firmware = running()
    for ms in range(0, 5000, 100):  # a sag that recovers
        firmware.registers[Id.BATTERY] = BATTERY_LAND + (ms // 100) % 2
        firmware.receive(0, c.encode_command(HOVER))
        firmware.advance(ms)
    assert firmware.motor_state is MotorState.ON
    firmware.registers[Id.BATTERY] = BATTERY_LAND
    for ms in range(5000, 5000 + BATTERY_TIME_MS + 200, 100):
        firmware.receive(0, c.encode_command(HOVER))
        firmware.advance(ms)
    assert now(firmware).motor_state is MotorState.EMERGENCY


def test_the_time_to_the_emergency_is_a_value_with_bounds() -> None:
    firmware = running()
    assert set_value(firmware, Id.EMERGENCY_TIMEOUT, 400) == 400
    assert set_value(firmware, Id.EMERGENCY_TIMEOUT, 0) == 400
    firmware.advance(400)
    assert firmware.motor_state is MotorState.ON
    firmware.advance(401)
    assert now(firmware).motor_state is MotorState.EMERGENCY


def test_a_mode_and_its_first_command_come_in_one_frame() -> None:
    firmware = running()
    assert set_value(firmware, Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT, HOVER) == 1
    assert firmware.command == HOVER
    level = (0, 0, 0, 110)
    assert set_value(firmware, Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING, level) == 0
    assert firmware.command == level
    assert set_value(firmware, Id.FLIGHT_CONTROL_MODE, 2, level) == 0


def test_in_the_emergency_nothing_is_set_any_more() -> None:
    firmware = running()
    before = set_value(firmware, Id.GAIN_P, 500)
    set_state(firmware, MotorState.EMERGENCY)
    assert set_value(firmware, Id.GAIN_P, 400) == before == 500
    assert set_value(firmware, Id.FLIGHT_CONTROL_MODE, 1) == FlightControlMode.NEAR_HOVERING


def test_measurements_and_identity_cannot_be_set() -> None:
    firmware = Firmware()
    for id in (Id.ROBOT_ID, Id.BATTERY, Id.PRESSURE, Id.COMMANDS_PER_SECOND, Id.MOTOR_REFERENCE_1):
        before = int(firmware.registers[id])
        assert set_value(firmware, id, before + 7) == before


def test_a_motor_controller_missing_on_the_bus_keeps_the_motors_off() -> None:
    firmware = Firmware()
    firmware.program["missing"] = 0b0100
    assert set_state(firmware, MotorState.ON) == MotorState.INIT


def test_statistics_count_a_second() -> None:
    firmware = running()
    for ms in range(1, 1001):
        firmware.advance(ms)
        if ms % 2 == 0:
            firmware.receive(ms // 2 % 2, c.encode_command(HOVER))
            firmware.next_data()
        firmware.statistics.steps(ms, 1, 1)
    names = (
        Id.COMMANDS_PER_SECOND,
        Id.LONGEST_COMMAND_GAP,
        Id.PACKETS_PER_SECOND,
        Id.LONGEST_PACKET_GAP,
        Id.CONTROL_STEPS_PER_SECOND,
        Id.SECOND_SERIAL_PACKETS_PER_SECOND,
    )
    # One more command than 500: the one that switched the motors on.
    assert [int(firmware.registers[id]) for id in names] == [501, 2, 500, 2, 1000, 250]


def test_a_request_is_answered_once_on_its_own_line() -> None:
    firmware = running()
    (echo,) = frames(firmware.receive(1, c.encode_request((1, 2, 3, 4), Id.BATTERY)))
    assert c.decode_value(echo) == (Id.BATTERY, 150)
    assert firmware.command == (1, 2, 3, 4)
    assert firmware.receive(1, b"") == b""


@pytest.mark.parametrize("id", [-1, 65, 20_000])
def test_a_request_for_nothing_is_not_answered(id: int) -> None:
    assert Firmware().receive(0, c.encode_request(STOPPED, id)) == b""


def test_data_come_from_both_lines_in_turn_with_the_time_modulo_a_minute() -> None:
    firmware = Firmware()
    seen = []
    for ms in (0, 1999, 2000, 62_000):
        firmware.advance(ms)
        port, data = firmware.next_data()
        values = c.decode_data(frames(data)[0])
        assert values is not None
        seen.append((port, values[0] & 0xFFFF))
    assert START_MS == 58_000
    assert seen == [(0, 58_000), (1, 59_999), (0, 0), (1, 0)]


def test_it_mirrors_what_it_is_asked_to() -> None:
    firmware = Firmware()
    ids = (Id.ROBOT_ID, Id.FIRMWARE_REVISION, *MIRROR[:8])
    (echo,) = frames(firmware.receive(0, c.encode_mirror(STOPPED, ids)))
    assert c.decode_mirrored(echo) == ids
    values = c.decode_data(frames(firmware.next_data()[1])[0])
    assert values is not None
    assert values[:2] == (1, 1)
    unknown = (100, *MIRROR[1:])
    (echo,) = frames(firmware.receive(0, c.encode_mirror(STOPPED, unknown)))
    assert c.decode_mirrored(echo) == ids


def test_damaged_frames_are_counted_and_obeyed_in_nothing() -> None:
    firmware = running()
    command = bytearray(c.encode_command(HOVER))
    command[5] ^= 1
    firmware.receive(0, bytes(command))
    assert firmware.command == STOPPED
    (echo,) = frames(firmware.receive(0, c.encode_request(STOPPED, Id.CRC_ERRORS)))
    assert c.decode_value(echo) == (Id.CRC_ERRORS, 1)


@given(st.lists(st.tuples(st.integers(0, 1), st.binary(max_size=120)), max_size=20))
@settings(max_examples=100, deadline=None)
def test_no_bytes_raise_and_a_whole_command_still_counts(pieces: list[tuple[int, bytes]]) -> None:
    firmware = running()
    for port, piece in pieces:
        firmware.receive(port, piece)
    if firmware.motor_state is MotorState.ON:
        firmware.receive(0, c.encode_command(HOVER))
        assert firmware.command == HOVER


@given(st.sampled_from("bsul"), st.binary(max_size=20))
@settings(max_examples=200, deadline=None)
def test_no_undamaged_frame_of_any_content_raises(command: str, payload: bytes) -> None:
    from vehicle_link.serial.frames import encode_frame

    firmware = Firmware()
    firmware.receive(0, encode_frame(command.encode(), payload))
    firmware.advance(10)
    assert len(firmware.next_data()[1]) == 34
