"""Counts and SI units of every id, and the command bytes of near-hovering mode."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from quadrotor.checkout import ROOT
from quadrotor.errors import OutOfBoundsError
from vehicle.simulator.firmware.firmware import LIMITS, WRITABLE
from vehicle_link.serial import commands
from vehicle_link.serial.attitude_command import (
    ANGLE_COUNTS,
    ANGLE_MAX,
    HOVER_THRUST,
    SIGNED_MAX,
    THRUST_MAX,
    THRUST_MIN,
    THRUST_SHARE_MAX,
    THRUST_SHARE_MIN,
    YAW_RATE_COUNTS,
    YAW_RATE_MAX,
    AttitudeCommand,
)
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import Id
from vehicle_link.serial.values import QUANTITIES, Quantity, quantity_of, to_si

PAGE = ROOT / "docs/boards/microcontroller.md"
byte = st.integers(0, 255)


# ---------------------------------------------------------------- values
def test_every_id_from_0_to_64_has_a_meaning() -> None:
    assert [int(id) for id in Id] == list(range(65))
    assert set(QUANTITIES) == set(Id)


@pytest.mark.parametrize(
    ("id", "raw", "value"),
    [
        (Id.BATTERY, 148, 14.8),
        (Id.PITCH, -450, -math.pi / 4),
        (Id.RATE_Z, 900, math.pi / 2),
        (Id.ACCELERATION_Z, 981, 9.81),
        (Id.TIME, 59_999 - 65_536, 59.999),  # unsigned: its int16 is negative
        (Id.PRESSURE, 6_000, 96_000.0),
        (Id.PRESSURE, -5_000, 85_000.0),
        (Id.TORQUE_YAW, -25, -0.025),
        (Id.EMERGENCY_THRUST, 110, 1.0),
        (Id.EMERGENCY_TIMEOUT, 250, 0.25),
        (Id.MIRROR_PERIOD, 2000, 0.002),
        (Id.GYROSCOPE_DRIFT_Y, -70, math.radians(-0.7)),
        (Id.MOTOR_REFERENCE_3, -1, -1.0),
        (Id.IMU_PERIOD_MIN, 20, 0.002),
        (Id.GAIN_P, 600, 60.0),
        (Id.GYROSCOPE_X, 512, 512.0),
    ],
)
def test_units(id: Id, raw: int, value: float) -> None:
    assert to_si(id, raw) == pytest.approx(value)


@pytest.mark.parametrize("id", list(Id))
def test_every_count_survives_the_line(id: Id) -> None:
    low, high = QUANTITIES[id].bounds
    for counts in {low, high, (low + high) // 2, *range(low, high, max(1, (high - low) // 500))}:
        raw = counts - 65536 if counts > 32767 else counts  # an int16 carries it
        (frame,) = FrameDecoder().feed(commands.encode_value(id, raw))
        reply = commands.decode_value(frame)
        assert reply is not None
        assert to_si(*reply) == to_si(id, counts)


def test_an_id_that_is_none_is_refused() -> None:
    with pytest.raises(OutOfBoundsError, match="no value 65; its ids are 0 to 64"):
        to_si(65, 0)


def page_row(id: Id, quantity: Quantity) -> str:
    unit = quantity.unit
    if unit == "m g":
        unit = f"{unit} / {quantity.counts_per_unit}"
    elif quantity.counts_per_unit != 1:
        unit = f"{1 / quantity.counts_per_unit:g} {unit}".rstrip()
    if quantity.offset:
        unit += f" - {quantity.offset:g}"
    low, high = quantity.bounds
    bounds = "" if high >= 32767 else f"{low}…{high}"
    access = "set" if quantity.writable else ""
    return f"| {int(id)} | {quantity.description} | {unit} | {bounds} | {access} |"


def test_the_page_lists_every_id_as_the_code_has_it() -> None:
    section = PAGE.read_text().split("## Values")[1].split("\n## ")[0]
    rows = re.findall(r"^\| \d+ \|.*$", section.replace(" *choice*", ""), re.MULTILINE)
    assert rows == [page_row(id, quantity_of(id)) for id in Id]


def test_the_firmware_takes_what_the_table_calls_writable() -> None:
    writable = {id for id, quantity in QUANTITIES.items() if quantity.writable}
    assert writable == WRITABLE | {Id.MOTOR_STATE}
    for id, bounds in LIMITS.items():
        assert quantity_of(id).bounds == bounds


# ---------------------------------------------------------------- near-hovering command
def test_the_bytes_of_a_command() -> None:
    hover = AttitudeCommand(0.0, 0.0, 0.0, 1.0)
    assert hover.encode() == (0, 0, 0, 110)
    some = AttitudeCommand(math.radians(-5), math.radians(10), math.radians(-30), 1.2)
    assert some.encode() == (40, 256 - 20, 256 - 30, 132)


def decode_attitude_command(counts: Sequence[int]) -> AttitudeCommand:
    """Decode four command bytes (0…255) of the near-hovering mode, within its limits."""
    pitch, roll, yaw_rate, thrust = counts
    return AttitudeCommand(
        roll=_from_byte(roll) / ANGLE_COUNTS,
        pitch=_from_byte(pitch) / ANGLE_COUNTS,
        yaw_rate=_from_byte(yaw_rate) / YAW_RATE_COUNTS,
        thrust_share=min(max(thrust, THRUST_MIN), THRUST_MAX) / HOVER_THRUST,
    )


def _from_byte(byte: int) -> int:
    """Decode an int8; -128, which is never sent, counts as -127."""
    return max(byte - 256 if byte > SIGNED_MAX else byte, -SIGNED_MAX)


def test_a_command_saturates_at_what_its_bytes_carry() -> None:
    most = AttitudeCommand(9.0, 9.0, 9.0, 9.0).encode()
    least = AttitudeCommand(-9.0, -9.0, -9.0, -9.0).encode()
    assert (most, least) == ((127, 127, 127, 210), (129, 129, 129, 28))
    assert math.degrees(ANGLE_MAX) == pytest.approx(31.75)
    assert math.degrees(YAW_RATE_MAX) == pytest.approx(127)
    assert decode_attitude_command(most) == AttitudeCommand(
        ANGLE_MAX, ANGLE_MAX, YAW_RATE_MAX, THRUST_SHARE_MAX
    )
    assert decode_attitude_command(least).thrust_share == THRUST_SHARE_MIN


@pytest.mark.parametrize("position", range(4))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_command_that_is_not_finite_is_refused(position: int, value: float) -> None:
    numbers = [0.0, 0.0, 0.0, 1.0]
    numbers[position] = value
    with pytest.raises(OutOfBoundsError, match="every number must be finite"):
        AttitudeCommand(*numbers).encode()


@given(byte, byte, byte, byte)
def test_any_four_bytes_mean_a_command_within_its_limits(a: int, b: int, c: int, d: int) -> None:
    command = decode_attitude_command((a, b, c, d))
    assert max(abs(command.roll), abs(command.pitch)) <= ANGLE_MAX
    assert abs(command.yaw_rate) <= YAW_RATE_MAX
    assert THRUST_SHARE_MIN <= command.thrust_share <= THRUST_SHARE_MAX
    assert decode_attitude_command(command.encode()) == command


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-2, 2), st.floats(0.3, 1.9))
def test_a_command_arrives_to_half_a_count(r: float, p: float, w: float, t: float) -> None:
    arrived = decode_attitude_command(AttitudeCommand(r, p, w, t).encode())
    assert arrived.roll == pytest.approx(r, abs=math.radians(0.1251))
    assert arrived.pitch == pytest.approx(p, abs=math.radians(0.1251))
    assert arrived.yaw_rate == pytest.approx(w, abs=math.radians(0.501))
    assert arrived.thrust_share == pytest.approx(t, abs=0.501 / 110)


def test_every_frame_takes_the_bytes_unchanged() -> None:
    counts = AttitudeCommand(-0.1, 0.2, -0.3, 0.9).encode()
    for data in (commands.encode_command(counts), commands.encode_set(counts, Id.GAIN_P, 600)):
        (frame,) = FrameDecoder().feed(data)
        instruction = commands.decode_instruction(frame)
        assert instruction is not None
        assert instruction.references == counts
