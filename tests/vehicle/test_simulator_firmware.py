"""The simulated firmware: what it obeys, echoes, refuses, and when it stops the motors."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehicle.simulator.firmware import COMMAND_TIMEOUT_MS, START_MS, Firmware
from vehicle_link.serial import commands as c
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, FlightControlMode, Id, MotorState

HOVER = (127, 127, 127, 127)
STOPPED = (0, 0, 0, 0)


def frames(data: bytes) -> list[Frame]:
    return FrameDecoder().feed(data)


def set_state(firmware: Firmware, state: int, references: tuple[int, ...] = STOPPED) -> int:
    """Ask for a motor state; the state that is echoed."""
    (echo,) = frames(firmware.receive(0, c.encode_set(references, Id.MOTOR_STATE, state)))
    reply = c.decode_value(echo)
    assert reply is not None
    assert reply[0] == Id.MOTOR_STATE
    return reply[1]


def running() -> Firmware:
    firmware = Firmware()
    assert set_state(firmware, MotorState.ON) == MotorState.ON
    return firmware


def test_motors_do_not_turn_unless_on() -> None:
    firmware = Firmware()
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.references == STOPPED
    set_state(firmware, MotorState.ON)
    firmware.receive(1, c.encode_command(HOVER))
    assert firmware.references == HOVER
    set_state(firmware, MotorState.OFF, HOVER)
    assert firmware.references == STOPPED
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.references == STOPPED


def test_every_frame_carries_the_command() -> None:
    for data in (
        c.encode_set(HOVER, Id.GAIN_P, 3),
        c.encode_request(HOVER, Id.BATTERY),
        c.encode_mirror(HOVER, MIRROR),
    ):
        firmware = running()
        firmware.receive(0, data)
        assert firmware.references == HOVER


def test_missing_commands_stop_the_motors_after_250_ms() -> None:
    firmware = running()
    firmware.advance(1000)
    assert firmware.motor_state is MotorState.EMERGENCY
    firmware = running()
    firmware.advance(100)
    firmware.receive(0, c.encode_command(HOVER))
    firmware.advance(100 + COMMAND_TIMEOUT_MS)
    assert (firmware.motor_state, firmware.references) == (MotorState.ON, HOVER)
    firmware.advance(101 + COMMAND_TIMEOUT_MS)
    assert (firmware.motor_state, firmware.references) == (MotorState.EMERGENCY, STOPPED)
    firmware.receive(0, c.encode_command(HOVER))
    assert firmware.references == STOPPED


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


@pytest.mark.parametrize("state", [-1, 4, 300, MotorState.EMERGENCY])
def test_states_that_cannot_be_set_are_answered_with_the_present_one(state: int) -> None:
    assert set_state(running(), state) == MotorState.ON


def test_it_knows_direct_mode_only() -> None:
    firmware = Firmware()
    for mode in FlightControlMode:
        data = c.encode_set(STOPPED, Id.FLIGHT_CONTROL_MODE, mode)
        (echo,) = frames(firmware.receive(0, data))
        assert c.decode_value(echo) == (Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT)


def test_a_request_is_answered_once_on_its_own_line() -> None:
    firmware = running()
    firmware.receive(0, c.encode_command((1, 2, 3, 4)))
    (echo,) = frames(firmware.receive(1, c.encode_request((1, 2, 3, 4), Id.MOTOR_REFERENCE_3)))
    assert c.decode_value(echo) == (Id.MOTOR_REFERENCE_3, 3)
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
    assert firmware.references == STOPPED
    (echo,) = frames(firmware.receive(0, c.encode_request(STOPPED, Id.CRC_ERRORS)))
    assert c.decode_value(echo) == (Id.CRC_ERRORS, 1)


@given(st.lists(st.tuples(st.integers(0, 1), st.binary(max_size=120)), max_size=20))
@settings(max_examples=100, deadline=None)
def test_no_bytes_raise_and_a_whole_command_still_counts(
    pieces: list[tuple[int, bytes]],
) -> None:
    firmware = running()
    for port, piece in pieces:
        firmware.receive(port, piece)
    if firmware.motor_state is MotorState.ON:
        firmware.receive(0, c.encode_command(HOVER))
        assert firmware.references == HOVER


@given(st.sampled_from("bsul"), st.binary(max_size=20))
@settings(max_examples=200, deadline=None)
def test_no_undamaged_frame_of_any_content_raises(command: str, payload: bytes) -> None:
    from vehicle_link.serial.frames import encode_frame

    firmware = Firmware()
    firmware.receive(0, encode_frame(command.encode(), payload))
    firmware.advance(10)
    assert len(firmware.next_data()[1]) == 34
