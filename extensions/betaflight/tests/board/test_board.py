"""The board with Betaflight, against a fake that answers MSP byte by byte."""

from __future__ import annotations

import itertools
import random
import struct

import pytest

from extensions.betaflight.board.arming import JUST_SWITCHED_ON
from extensions.betaflight.board.board import RESTARTED, BetaflightBoard
from extensions.betaflight.board.messages import Function
from extensions.betaflight.board.options import BetaflightOptions
from extensions.betaflight.msp.frames import ERROR, REPLY, MessageDecoder, encode
from quadrotor.errors import OutOfBoundsError
from quadrotor.motor_state import MotorState
from vehicle.boards.board import BodyRates, RawSample
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.port import MemoryPort, memory_port_pair

BOXES = bytes((0, 1, 2, 27))  # arm, angle, horizon, failsafe
STEP_S, HOVER = 0.004, BodyRates((0.0, 0.0, 0.0), 0.4)


class Firmware:
    """Fake firmware at the other end, which answers as MSP does and stores the newest sticks."""

    def __init__(self, port: MemoryPort) -> None:
        self.port, self.decoder = port, MessageDecoder()
        self.version, self.variant = bytes((4, 5, 1)), b"BTFL"
        self.blocks = self.boxes = 0
        self.imu = (12, -7, 2048, 3, -4, 5, 0, 0, 0)
        self.sticks: list[int] = []
        self.deaf: set[int] = set()

    def step(self) -> None:
        for message in self.decoder.feed(self.port.read()):
            if message.function == Function.SET_RC:
                self.sticks = [pulse for (pulse,) in struct.iter_unpack("<H", message.payload)]
            answer = {
                Function.VARIANT: self.variant,
                Function.VERSION: self.version,
                Function.BOX_IDS: BOXES,
                Function.RAW_IMU: struct.pack("<9h", *self.imu),
                Function.ANALOG: struct.pack("<BHHhH", 160, 0, 0, 0, 1612),
                Function.STATUS: struct.pack("<HHHIBHBB", 125, 0, 33, self.boxes, 0, 12, 4, 0)
                + bytes((1, 0, 29))
                + struct.pack("<IB", self.blocks, 0),
            }.get(message.function)  # type: ignore[call-overload]
            if message.function in self.deaf:
                self.port.write(encode(message.function, b"", ERROR))
            elif answer is not None:
                self.port.write(encode(message.function, answer, REPLY))


class Bench:
    def __init__(self, unfit: str = "", options: BetaflightOptions | None = None) -> None:
        near, far = memory_port_pair()
        self.firmware, self.now_s = Firmware(far), 1.0
        self.board = BetaflightBoard(
            [near],
            options or BetaflightOptions(),
            rate=250,
            now_ns=lambda: round(1e9 * self.now_s),
            unfit=unfit,
        )

    def go(self, steps: int) -> list[RawSample]:
        samples = []
        for _ in range(steps):
            self.board.service(self.now_s)
            self.now_s += 0.5 * STEP_S
            self.firmware.step()
            samples += self.board.receive()
            self.now_s += 0.5 * STEP_S
        return samples


def test_samples_come_at_the_rate_with_counts_battery_and_state() -> None:
    bench = Bench()
    bench.go(50)
    samples = bench.go(250)
    assert len(samples) == 250
    assert {b.stamp_ns - a.stamp_ns for a, b in itertools.pairwise(samples)} == {4_000_000}
    newest = samples[-1]
    assert (newest.accelerometer, newest.gyroscope) == ((12, -7, 2048), (3, -4, 5))
    assert newest.battery_voltage == pytest.approx(16.12)
    assert newest.motor_state is MotorState.OFF
    assert newest.stamp_ns == pytest.approx(1e9 * (bench.now_s - 0.75 * STEP_S), abs=2)


def test_it_arms_when_nothing_blocks_and_reports_it() -> None:
    bench = Bench()
    bench.firmware.blocks = 1 << 7
    bench.go(60)
    bench.board.set_motor_state(MotorState.ON)
    bench.go(60)
    assert bench.firmware.sticks[4] == 1000
    assert bench.board.obstacle.startswith("THROTTLE: the throttle is not at its lowest")
    bench.firmware.blocks = 0
    bench.go(60)
    assert bench.firmware.sticks[4] == 2000
    bench.firmware.boxes = 1
    assert bench.go(60)[-1].motor_state is MotorState.ON
    bench.board.set_motor_state(MotorState.EMERGENCY)
    bench.firmware.boxes = 1 | 1 << 3
    bench.firmware.sticks = []
    assert bench.go(60)[-1].motor_state is MotorState.EMERGENCY
    assert bench.firmware.sticks == []  # without sticks, the firmware lands
    bench.board.set_motor_state(MotorState.OFF)
    bench.go(10)
    assert (bench.firmware.sticks[4], bench.firmware.sticks[6]) == (1000, 1000)


def armed_bench() -> Bench:
    bench = Bench()
    bench.firmware.boxes = 1
    bench.board.set_motor_state(MotorState.ON)
    bench.go(60)
    return bench


def test_until_it_is_armed_the_throttle_stays_at_its_lowest() -> None:
    bench = Bench()
    bench.go(60)
    bench.board.set_motor_state(MotorState.ON)
    bench.board.command(HOVER)
    bench.firmware.step()
    assert bench.firmware.sticks[2:5] == [1000, 1500, 2000]
    bench.firmware.boxes = 1
    bench.go(60)
    bench.board.command(HOVER)
    bench.firmware.step()
    # 1010 + 990 (0.4 - 0.055) / 0.945 = 1371.4, plus the remainder of the rounding before
    assert bench.firmware.sticks[2] in (1371, 1372)


def test_rates_and_angles_become_sticks() -> None:
    bench = armed_bench()
    full = BodyRates((6.981317, -3.490659, 3.490659), 1.0)  # 400, -200, 200 deg/s
    bench.board.command(full)
    bench.firmware.step()
    assert bench.firmware.sticks == [2000, 1250, 2000, 1250, 2000, 1000, 1000, 1000]
    bench.board.command(AttitudeCommand(0.0, 0.3054326, 0.0, 1.0, 12.8, 0.055))  # 17.5 deg
    bench.firmware.step()
    assert bench.firmware.sticks == [1500, 1750, 1010, 1500, 2000, 2000, 1000, 1000]


def test_the_mean_of_the_sticks_is_what_was_wanted() -> None:
    bench = armed_bench()
    pulses = []
    for _ in range(200):
        bench.board.command(BodyRates((0.02, 0.0, 0.0), 0.4))
        bench.firmware.step()
        pulses.append(bench.firmware.sticks[0])
    wanted = 1500.0 + 500.0 * 0.02 / 6.981317
    assert sum(pulses) / len(pulses) == pytest.approx(wanted, abs=0.01)


def test_a_board_takes_no_motor_references() -> None:
    with pytest.raises(OutOfBoundsError, match="board betaflight takes body rates"):
        Bench().board.command((60, 60, 60, 60))


@pytest.mark.parametrize(
    ("variant", "version", "why"),
    [
        (b"INAV", (7, 1, 0), "the board's firmware calls itself 'INAV', not Betaflight"),
        (b"BTFL", (4, 4, 2), "Betaflight 4.4.2 is older than 4.5"),
        (b"BTFL", (4, 7, 0), "Betaflight 4.7.0 is newer than 4.6, the newest that was tried"),
    ],
)
def test_another_firmware_never_arms(variant: bytes, version: tuple[int, ...], why: str) -> None:
    bench = Bench()
    bench.firmware.variant, bench.firmware.version = variant, bytes(version)
    bench.go(60)
    bench.board.set_motor_state(MotorState.ON)
    bench.go(60)
    assert bench.firmware.sticks[4] == 1000
    assert why in bench.board.obstacle


def test_a_newer_firmware_is_flown_on_request() -> None:
    bench = Bench(options=BetaflightOptions(newer=True))
    bench.firmware.version = bytes((25, 12, 0))
    bench.go(60)
    assert bench.board.obstacle == ""


def test_a_board_that_does_not_fit_never_arms() -> None:
    bench = Bench(unfit="settings do not fit")
    bench.go(60)
    bench.board.set_motor_state(MotorState.ON)
    bench.go(60)
    assert bench.firmware.sticks[4] == 1000
    assert bench.board.obstacle == "settings do not fit"


def test_a_command_after_the_hand_over_is_not_sent() -> None:
    bench = Bench()
    bench.go(60)
    bench.board.set_motor_state(MotorState.ON)
    bench.firmware.boxes = 1
    bench.go(60)
    bench.board.set_motor_state(MotorState.EMERGENCY)
    bench.firmware.sticks = []
    bench.board.command(BodyRates((1.0, -1.0, 0.5), 0.4))  # from the tick that decided it
    bench.go(60)
    assert bench.firmware.sticks == []


def test_a_command_is_never_repeated_so_that_the_failsafe_sees_the_end_of_the_ticks() -> None:
    bench = armed_bench()
    bench.board.command(HOVER)
    bench.firmware.step()
    bench.firmware.sticks = []
    bench.go(60)
    assert bench.firmware.sticks == []
    bench.board.set_motor_state(MotorState.OFF)
    bench.go(10)
    assert bench.firmware.sticks[2:5] == [1000, 1500, 1000]


def test_what_blocks_arming_does_not_stop_motors_in_the_air() -> None:
    bench = armed_bench()
    bench.firmware.port.write(encode(Function.RAW_IMU, b"12", REPLY))
    bench.go(60)
    assert bench.board.failures
    bench.board.command(HOVER)
    bench.firmware.step()
    assert bench.firmware.sticks[4] == 2000


def test_a_board_that_restarts_in_flight_is_told_and_not_armed_again() -> None:
    bench = armed_bench()
    bench.firmware.boxes, bench.firmware.blocks = 0, JUST_SWITCHED_ON
    assert bench.go(60)[-1].motor_state is MotorState.OFF
    assert bench.board.failures == [RESTARTED]
    bench.firmware.blocks = 0
    bench.go(60)
    assert bench.board.obstacle == RESTARTED
    assert bench.firmware.sticks[4] == 1000


def test_a_lost_answer_costs_some_samples_and_an_error_none() -> None:
    bench = Bench()
    bench.go(50)
    bench.firmware.port.read()  # a request that never arrives
    bench.board.service(bench.now_s)
    bench.firmware.port.read()
    assert len(bench.go(100)) > 90
    bench.firmware.deaf = {Function.ANALOG}
    assert len(bench.go(100)) == 100


def test_garbage_between_the_answers_costs_nothing_and_is_counted() -> None:
    bench = Bench()
    bench.go(60)
    generator = random.Random(5)
    for _ in range(50):
        bench.firmware.port.write(generator.randbytes(40).replace(b"$", b"#"))
        assert len(bench.go(1)) == 1
    assert bench.board.obstacle == ""
    assert bench.board.failures == []
    assert bench.board.damaged > 0


def test_short_answers_are_told_once_and_block_arming() -> None:
    bench = Bench()
    bench.go(60)
    for _ in range(3):
        bench.firmware.port.write(encode(Function.RAW_IMU, b"12", REPLY))
    bench.board.receive()
    [line] = bench.board.failures
    assert line.startswith("MSP RAW_IMU has 2 bytes, at least 12 are expected")
    assert bench.board.refused == 3
    assert bench.board.obstacle == line
