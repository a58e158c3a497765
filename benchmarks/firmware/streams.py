"""Input of the microcontroller's firmware, recorded in flight or fuzzed, and its answers."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from quadrotor.motor_state import MotorState
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial import commands as c
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.frames import encode_frame
from vehicle_link.serial.ids import FlightControlMode, Id

SENSORS = (*range(6), int(Id.BATTERY), int(Id.PRESSURE))
"""Ids of the values that the sensors write."""
BATCH = 250
"""Largest number of bytes in one step."""


@dataclass(frozen=True, slots=True)
class Step:
    """The input of one period."""

    sixteenths: int  # 1/16 us, the period
    ms: int  # since power-up
    port: int
    data: bytes  # received on the port before the period
    sensors: tuple[int, ...]
    missing: int = 0  # bits of the motors


class AnyFirmware(Protocol):
    """The common part of the Python and the C firmware."""

    registers: npt.NDArray[np.int16]

    @property
    def references(self) -> tuple[int, ...]: ...
    @property
    def command(self) -> tuple[int, int, int, int]: ...
    def receive(self, port: int, data: bytes) -> bytes: ...
    def advance(self, elapsed_ms: int) -> None: ...
    def period(self, command: tuple[int, int, int, int]) -> None: ...
    def next_data(self) -> tuple[int, bytes]: ...
    def steps(self, ms: int, count: int, step_ms: int) -> None: ...
    def set_period(self, sixteenths: int) -> None: ...
    def set_missing(self, motors: int) -> None: ...


Answer = tuple[bytes, int, bytes, tuple[int, ...], bytes]
"""Answer to one step: replies; port and `D` frame; motor references; all values."""


def answer(firmware: AnyFirmware, step: Step) -> Answer:
    """Return a firmware's answer to one step."""
    firmware.set_period(step.sixteenths)
    firmware.set_missing(step.missing)
    firmware.advance(step.ms)
    replies = firmware.receive(step.port, step.data)
    for id, count in zip(SENSORS, step.sensors, strict=True):
        firmware.registers[id] = count
    firmware.period(firmware.command)
    firmware.steps(step.ms, 1, 1)
    port, data = firmware.next_data()
    return replies, port, data, firmware.references, firmware.registers.tobytes()


def flown(seed: int, count: int) -> Iterator[Step]:
    """Yield the periods of a flight at 1 kHz, which repeats.

    It takes off, flies manoeuvres in both modes, and descends autonomously.
    """
    simulated = SimulatedVehicle(SimulatorParameters(seed=seed, imu_rate=1000))
    generator, registers = random.Random(seed), simulated.firmware.registers
    angles = [0.0, 0.0, 0.0]
    for k in range(count):
        second, port = k // 1000 % 12, k % 2
        height, climb = simulated.truth["position_w"][0, 2], simulated.truth["velocity_w"][0, 2]
        share = 1.0 + (2.0 * (1.5 - height) - 3.0 * climb) / 9.81
        if k % 250 == 0:
            angles = [generator.uniform(-0.1, 0.1) for _ in range(3)] if second > 3 else [0.0] * 3
        command = AttitudeCommand(angles[0], angles[1], angles[2], share).encode()
        data = c.encode_command(command)
        if k % 12_000 == 0:
            data = c.encode_set(command, Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING)
        elif k % 12_000 == 500:
            data = c.encode_set(command, Id.MOTOR_STATE, MotorState.ON)
        elif second >= 8:  # no commands: it lands by itself, and motors can start again
            data = (
                c.encode_set(command, Id.MOTOR_STATE, MotorState.OFF)
                if k % 12_000 == 11_999
                else b""
            )
        elif 6 <= second < 7 and k % 1000 < 100:
            references = [int(reference) for reference in simulated.firmware.references]
            data = c.encode_set(references, Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT)
        elif second == 6 and k % 1000 == 100:
            data = c.encode_set(command, Id.FLIGHT_CONTROL_MODE, FlightControlMode.NEAR_HOVERING)
        elif k % 50 == 0:
            data += c.encode_request(command, generator.randrange(65))
        simulated.ports[port].write(data)
        simulated.step()
        for each in simulated.ports:
            each.read()
        ms = simulated.stamp_ns // 1_000_000
        yield Step(16_000, ms, port, data, tuple(int(registers[id]) for id in SENSORS))


def fuzzed(seed: int, count: int) -> Iterator[Step]:
    """Yield periods with any length, bytes and sensors; half of them are near those of a flight."""
    generator = random.Random(seed)
    ms, sixteenths, missing = 0, 16_000, 0
    for k in range(count):
        if k % 5000 == 0:
            sixteenths = generator.randrange(500, 2**16)
        if k % 100 == 0:
            missing = generator.randrange(16) if generator.random() < 0.05 else 0
        ms += generator.choice((0, 1, 1, 1, 2)) + (k % 1000 == 0) * generator.randrange(2000)
        wild = k // 10_000 % 2 == 1
        sensors = [_count(generator, wild, 256 if axis == 2 else 0) for axis in range(6)]
        sensors.append(150 if generator.random() < 0.99 else generator.randrange(-300, 300))
        pressure = generator.randrange(-32768, 32768) if wild else generator.gauss(10_000, 5)
        data = _bytes(generator)[:BATCH]
        yield Step(sixteenths, ms, k % 2, data, (*sensors, int(pressure)), missing)


def _count(generator: random.Random, wild: bool, about: int) -> int:
    if wild:
        return (
            generator.randrange(-32768, 32768)
            if generator.random() < 0.1
            else generator.randrange(1024)
        )
    return min(1023, max(0, round(512 + about + generator.gauss(0, 20))))


def _bytes(generator: random.Random) -> bytes:
    command = [generator.randrange(256) for _ in range(4)]
    kind = generator.random()
    if kind < 0.5:
        return c.encode_command(command)
    if kind < 0.7:
        id = generator.choice((*range(65), 42, generator.randrange(-100, 200)))
        return c.encode_set(
            command, id, generator.choice((0, 1, 300, generator.randrange(-(2**15), 2**15)))
        )
    if kind < 0.75:
        return c.encode_set(command, Id.MOTOR_STATE, generator.choice((0, 1, 1, 1, 2, 3)))
    if kind < 0.8:
        return c.encode_request(command, generator.randrange(-5, 70))
    if kind < 0.85:
        return c.encode_mirror(command, [generator.randrange(66) for _ in range(10)])
    if kind < 0.9:
        return generator.randbytes(generator.randrange(200))
    frame = encode_frame(
        bytes([generator.choice(b"bsulSDLx")]), generator.randbytes(generator.randrange(48))
    )
    damaged = bytearray(frame + b"#b==\r#"[: generator.randrange(7)])
    if generator.random() < 0.5:
        damaged[generator.randrange(len(damaged))] = generator.randrange(256)
    return bytes(damaged)
