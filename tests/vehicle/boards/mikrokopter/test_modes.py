"""Changes of the flight control mode, and ports that fail in flight."""

from __future__ import annotations

import pytest

from quadrotor.errors import LinkError
from quadrotor.motor_state import MotorState
from tests.support.narrowing import now
from vehicle.boards.board import Command, RawSample
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.commands import decode_instruction
from vehicle_link.serial.frames import FrameDecoder
from vehicle_link.serial.ids import FlightControlMode, Id
from vehicle_link.serial.port import MemoryPort, memory_port_pair

DIRECT, NEAR_HOVERING = FlightControlMode.DIRECT, FlightControlMode.NEAR_HOVERING
CLIMB = (135, 135, 135, 135)
LEVEL = AttitudeCommand(0.0, 0.0, 0.0, 1.05)


class Pulled(MemoryPort):
    """Line that is unplugged when the test requests it."""

    gone = False

    def read(self) -> bytes:
        if self.gone:
            raise LinkError("serial port mcu is gone: pulled")
        return super().read()

    def write(self, data: bytes) -> None:
        if self.gone:
            raise LinkError("serial port mcu is gone: pulled")
        super().write(data)


class Bench:
    def __init__(self) -> None:
        pairs = [memory_port_pair() for _ in range(2)]
        self.near = []
        for _, far in pairs:
            pulled = Pulled()
            pulled._peer, far._peer = far, pulled
            self.near.append(pulled)
        self.robot = SimulatedVehicle(SimulatorParameters(), [far for _, far in pairs])
        self.mcu = Microcontroller(self.near, 0)

    @property
    def mode(self) -> int:
        return int(self.robot.firmware.registers[Id.FLIGHT_CONTROL_MODE])

    def go(self, steps: int, command: Command) -> list[RawSample]:
        samples = []
        for _ in range(steps):
            self.robot.step()
            samples += self.mcu.receive()
            self.mcu.command(command)
            self.mcu.service(self.robot.stamp_ns * 1e-9)
        return samples

    def start(self) -> None:
        self.mcu.set_motor_state(MotorState.ON)
        self.go(50, CLIMB)
        assert self.robot.firmware.motor_state is MotorState.ON


def test_bytes_of_one_mode_are_never_read_in_the_other() -> None:
    bench = Bench()
    bench.start()
    firmware, seen = bench.robot.firmware, []
    receive = firmware.receive

    def spy(port: int, data: bytes) -> bytes:
        for frame in FrameDecoder().feed(data):
            instruction = decode_instruction(frame)
            assert instruction is not None
            before = bench.mode
            replies = receive(port, data)
            seen.append((before, bench.mode, instruction.references))
            return replies
        return receive(port, data)

    firmware.receive = spy  # type: ignore[method-assign]
    for _ in range(3):
        bench.go(20, LEVEL)
        assert bench.mode == NEAR_HOVERING
        bench.go(20, CLIMB)
        assert bench.mode == DIRECT
    meant = {LEVEL.encode(): NEAR_HOVERING, CLIMB: DIRECT}
    assert all(after == meant[bytes_] for _, after, bytes_ in seen)
    assert sum(before != after for before, after, _ in seen) == 6


def test_a_mode_counts_when_it_is_echoed() -> None:
    bench = Bench()
    bench.start()
    bench.mcu.command(LEVEL)
    assert bench.mcu.flight_control_mode is DIRECT
    bench.robot.step()
    bench.mcu.receive()
    assert bench.mcu.flight_control_mode is NEAR_HOVERING


@pytest.mark.parametrize("index", [0, 1])
def test_one_port_pulled_in_flight_leaves_the_other(index: int) -> None:
    bench = Bench()
    bench.start()
    before = len(bench.go(100, CLIMB))
    bench.near[index].gone = True
    samples = bench.go(100, CLIMB)
    assert (before, len(samples)) == (100, 50)
    assert bench.robot.firmware.motor_state is MotorState.ON
    assert bench.mcu.lost_ports == 1
    [line] = bench.mcu.failures
    assert "is gone: pulled; flying on with the other port, at half the rate" in line
    bench.mcu.set_motor_state(MotorState.OFF)
    bench.go(2, CLIMB)
    assert now(bench).robot.firmware.motor_state is MotorState.OFF


def test_both_ports_pulled_end_it() -> None:
    bench = Bench()
    bench.start()
    for port in bench.near:
        port.gone = True
    with pytest.raises(LinkError, match=r"is gone: pulled; .* is gone: pulled"):
        bench.mcu.receive()
    assert bench.mcu.failures == []


@pytest.mark.parametrize("index", [0, 1])
def test_a_second_port_pulled_later_ends_it_after_the_first_was_told(index: int) -> None:
    bench = Bench()
    bench.start()
    bench.near[index].gone = True
    bench.go(4, CLIMB)
    bench.near[1 - index].gone = True
    with pytest.raises(LinkError) as error:
        bench.mcu.receive()
    assert str(error.value).count("is gone") == 1
    [line] = bench.mcu.failures
    assert "flying on with the other port" in line


def test_damage_on_a_port_that_is_gone_still_counts() -> None:
    bench = Bench()
    bench.near[1]._peer.write(b"#rubbish\r")
    bench.mcu.receive()
    bench.near[1].gone = True
    bench.mcu.receive()
    assert bench.mcu.damaged == 1


def test_a_value_is_set_until_echoed() -> None:
    bench = Bench()
    bench.mcu.set_command_timeout(400)
    bench.go(20, CLIMB)
    assert bench.robot.firmware.registers[Id.EMERGENCY_TIMEOUT] == 400
    assert bench.mcu.failures == []
