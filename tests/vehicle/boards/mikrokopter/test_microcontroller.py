"""Flight side of the serial lines: handshake, samples in order, sets until echoed."""

from __future__ import annotations

from itertools import pairwise

import pytest

from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from vehicle.boards.board import RawSample
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.identity import Identity
from vehicle_link.serial.commands import encode_data, encode_mirrored, encode_value
from vehicle_link.serial.exchange import TRIES
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import MIRROR, Id
from vehicle_link.serial.port import MemoryPort, memory_port_pair

LEVEL = (512, 512, 768, 512, 512, 512)


def data(ms: int, counts: tuple[int, ...] = LEVEL, battery: int = 148, state: int = 3) -> bytes:
    values = (ms, *counts, battery, state, 6000)
    return encode_data(b"".join((value & 0xFFFF).to_bytes(2, "little") for value in values))


class Lines:
    """A Microcontroller whose other ends the test writes and reads."""

    def __init__(self, epoch_ns: int | None = 0) -> None:
        pairs = [memory_port_pair(), memory_port_pair()]
        self.far = [pair[1] for pair in pairs]
        self.mcu = Microcontroller([pair[0] for pair in pairs], epoch_ns)

    def confirm(self) -> None:
        """Answer the handshake as the correct firmware does."""
        firmware = Firmware(1)
        self.far[0].write(firmware.receive(0, self.far[0].read()))
        assert self.mcu.receive() == []

    def sent(self, line: int = 0) -> str:
        """Return the kinds of the frames sent on this line since the last call."""
        return "".join(chr(f.command) for f in FrameDecoder().feed(self.far[line].read()))


def stamps_ms(samples: list[RawSample]) -> list[float]:
    return [sample.stamp_ns / 1e6 for sample in samples]


def fly(simulated: SimulatedVehicle, mcu: Microcontroller, steps: int) -> list[RawSample]:
    samples = []
    for _ in range(steps):
        simulated.step()
        samples += mcu.receive()
        mcu.service(simulated.stamp_ns * 1e-9)
    return samples


# ---------------------------------------------------------------- handshake
def test_it_asks_for_the_mirror_who_it_is_and_direct_mode_at_once() -> None:
    lines = Lines()
    assert lines.sent() == "lsuus"
    assert not lines.mcu.connected


def test_samples_count_only_once_the_mirror_is_confirmed() -> None:
    lines = Lines()
    lines.far[0].write(data(1000))
    assert lines.mcu.receive() == []
    lines.far[0].write(encode_mirrored(tuple(reversed(MIRROR))) + data(1002))
    assert lines.mcu.receive() == []
    lines.far[0].write(encode_mirrored(MIRROR) + data(1004))
    assert len(lines.mcu.receive()) == 1


def test_a_value_of_no_id_neither_confirms_the_mirror_nor_takes_it_back() -> None:
    lines = Lines()
    lines.far[0].write(encode_value(-1, 0))
    lines.mcu.receive()
    lines.sent()
    lines.mcu.service(0.0)
    assert lines.sent() == "lsuus"
    lines.mcu.service(0.1)
    lines.confirm()
    lines.far[0].write(encode_value(-1, 0) + data(1000))
    assert len(lines.mcu.receive()) == 1


def test_the_handshake_goes_on_for_a_microcontroller_switched_on_later() -> None:
    lines = Lines()
    for step in range(400):
        lines.mcu.service(step * 0.01)
    assert len(lines.mcu.failures) == 1
    lines.sent()
    for step in range(400, 520):
        lines.mcu.service(step * 0.01)
    lines.confirm()
    assert lines.mcu.connected
    assert len(lines.mcu.failures) == 1


def test_the_wrong_robot_is_reported_and_gets_no_motors() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0, identity=Identity(robot_id=7))
    mcu.set_motor_state(MotorState.ON)
    samples = fly(simulated, mcu, 1000)
    assert not mcu.connected
    assert samples[-1].motor_state is MotorState.INIT
    assert "confirm that robot_id is 7 in 40 tries, 1.0 s; it answered 1." in mcu.failures[0]
    assert "it is not recognised yet" in mcu.failures[1]


@pytest.mark.parametrize("count", [0, 3])
def test_it_has_one_or_two_ports(count: int) -> None:
    with pytest.raises(LinkError, match=f"{count} serial ports given; .* one or two"):
        Microcontroller([MemoryPort() for _ in range(count)])


# ---------------------------------------------------------------- samples
def test_the_fields_of_a_sample() -> None:
    lines = Lines()
    lines.confirm()
    lines.far[0].write(data(100, (1, 2, 3, 4, 5, 1023), battery=148, state=1))
    (sample,) = lines.mcu.receive()
    assert sample.accelerometer == (1, 2, 3)
    assert sample.gyroscope == (4, 5, 1023)
    assert sample.battery_voltage == pytest.approx(14.8)
    assert sample.pressure == 96_000.0
    assert sample.motor_state is MotorState.ON


def test_samples_of_both_ports_come_in_order_through_the_wrap_of_the_clock() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    samples = fly(simulated, mcu, 2500)
    assert stamps_ms(samples) == [2.0 * k for k in range(2500)]
    assert (mcu.damaged, mcu.refused, mcu.late) == (0, 0, 0)


def test_what_waited_on_two_ports_is_merged_by_time() -> None:
    lines = Lines()
    lines.confirm()
    lines.far[0].write(data(59_996) + data(0))
    lines.far[1].write(data(59_998) + data(2))
    assert stamps_ms(lines.mcu.receive()) == [0, 2, 4, 6]


def test_late_and_double_samples_are_dropped_and_counted() -> None:
    lines = Lines()
    lines.confirm()
    lines.far[0].write(data(100) + data(104))
    assert stamps_ms(lines.mcu.receive()) == [0, 4]
    lines.far[1].write(data(102) + data(104) + data(106))
    assert stamps_ms(lines.mcu.receive()) == [6]
    assert lines.mcu.late == 2


def test_a_jump_of_the_clock_is_believed_when_confirmed() -> None:
    lines = Lines()
    lines.confirm()
    lines.far[0].write(data(100) + data(30_000) + data(102))
    assert stamps_ms(lines.mcu.receive()) == [0, 2]
    lines.far[0].write(data(5_000) + data(5_002) + data(5_004))
    assert stamps_ms(lines.mcu.receive()) == [4902, 4904]
    assert lines.mcu.refused == 2


@pytest.mark.parametrize(
    "frame",
    [
        data(102, (512, 512, 1024, 512, 512, 512)),
        data(102, (512, 512, 768, -1, 512, 512)),
        data(102, state=4),
        data(102, battery=-1),
    ],
)
def test_impossible_values_that_pass_the_crc_are_refused(frame: bytes) -> None:
    lines = Lines()
    lines.confirm()
    lines.far[0].write(data(100) + frame + data(104))
    assert stamps_ms(lines.mcu.receive()) == [0, 4]
    assert lines.mcu.refused == 1


def test_damage_on_the_line_costs_only_what_it_hit() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    fly(simulated, mcu, 10)
    far = simulated._wires
    stamps: list[float] = []
    for k in range(100):
        if k % 10 == 5:
            far[0].write(b"#bD\xff\x00noise\r")
        simulated.step()
        stamps += stamps_ms(mcu.receive())
    assert stamps == [2.0 * k for k in range(10, 110)]
    assert mcu.damaged == 10


# ---------------------------------------------------------------- commands and sets
def test_commands_take_turns_on_the_ports() -> None:
    lines = Lines()
    lines.confirm()
    for _ in range(5):
        lines.mcu.command((30, 30, 30, 30))
    assert (lines.sent(0), lines.sent(1)) == ("bbb", "bb")


def test_a_set_is_repeated_every_25_ms_40_times_then_reported() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.set_motor_state(MotorState.ON)
    times = []
    for ms in range(3000):
        lines.mcu.service(ms * 1e-3)
        if lines.sent():
            times.append(ms)
    assert len(times) == TRIES
    assert {b - a for a, b in pairwise(times)} <= {25, 26}
    assert lines.mcu.failures == [
        "microcontroller: could not set motor_state to 1 in 40 tries, 1.0 s; it answered nothing. "
        "Check the cables, the ports and its firmware"
    ]


def test_a_set_ends_with_its_echo_and_not_with_another_value() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.set_motor_state(MotorState.ON)
    lines.mcu.service(0.0)
    lines.far[0].write(encode_value(Id.MOTOR_STATE, MotorState.EMERGENCY))
    lines.mcu.receive()
    lines.mcu.service(0.03)
    assert lines.sent() == "ss"
    lines.far[0].write(encode_value(Id.MOTOR_STATE, MotorState.ON))
    lines.mcu.receive()
    lines.mcu.service(0.06)
    assert lines.sent() == ""


def test_motors_off_is_asked_for_until_it_is_so() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.set_motor_state(MotorState.OFF)
    for ms in range(0, 5000, 5):
        lines.mcu.service(ms * 1e-3)
    assert len(lines.mcu.failures) == 1
    lines.sent()
    for ms in range(5000, 7000, 5):
        lines.mcu.service(ms * 1e-3)
    assert lines.sent() != ""


def test_a_new_motor_state_replaces_the_one_still_asked_for() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    fly(simulated, mcu, 20)
    mcu.set_motor_state(MotorState.ON)
    mcu.set_motor_state(MotorState.OFF)
    assert fly(simulated, mcu, 30)[-1].motor_state is MotorState.OFF


def test_sets_carry_the_last_references_but_none_once_motors_are_off() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.command((40, 41, 42, 43))
    lines.sent()
    for state, expected in ((MotorState.ON, (40, 41, 42, 43)), (MotorState.OFF, (0, 0, 0, 0))):
        lines.mcu.set_motor_state(state)
        lines.mcu.service(0.0)
        (frame,) = FrameDecoder().feed(lines.far[0].read())
        assert tuple(frame.payload[:4]) == expected


def test_what_one_sample_alone_says_of_the_motors_is_not_believed() -> None:
    lines = Lines()
    lines.confirm()
    states = [MotorState.ON] * 3 + [MotorState.OFF] + [MotorState.ON] * 2 + [MotorState.OFF] * 3
    told = []
    for k, state in enumerate(states):
        lines.far[0].write(data(1000 + 2 * k, state=state))
        told += [sample.motor_state for sample in lines.mcu.receive()]
    assert told == [MotorState.ON] * 7 + [MotorState.OFF] * 2


def test_a_command_is_repeated_while_no_sample_comes_but_not_for_long() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.command((1, 2, 3, 4))
    lines.mcu.service(10.0)
    lines.sent(0), lines.sent(1)
    sent = {}
    for ms in range(1, 200):
        lines.mcu.service(10.0 + 0.001 * ms)
        sent[ms] = lines.sent(0).count("b") + lines.sent(1).count("b")
    at = [ms for ms, count in sent.items() if count]
    assert 4 <= len(at) <= 7
    assert at[0] <= 8
    assert at[-1] < 40, "the microcontroller must land when nothing new comes"


def test_no_command_is_repeated_once_the_motors_are_to_stop() -> None:
    lines = Lines()
    lines.confirm()
    lines.mcu.command((1, 2, 3, 4))
    lines.mcu.service(10.0)
    lines.mcu.set_motor_state(MotorState.OFF)
    lines.sent(0), lines.sent(1)
    for ms in range(1, 60):
        lines.mcu.service(10.0 + 0.001 * ms)
    assert "b" not in lines.sent(0) + lines.sent(1)
