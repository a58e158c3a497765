"""The C firmware: built by gcc, equal to the Python one to the count."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest

from benchmarks.firmware import chip
from benchmarks.firmware.image import judge
from benchmarks.firmware.streams import Step, answer, flown, fuzzed
from quadrotor.errors import StorageError
from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware import header, native
from vehicle.simulator.firmware.constants import HALF_TURN
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.firmware.fixed import angle_of, by16, root
from vehicle.simulator.firmware.native import NativeFirmware
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle_link.serial import commands as c
from vehicle_link.serial.ids import Id


def test_the_header_has_the_numbers_of_the_python_firmware() -> None:
    assert header.PATH.read_text() == header.header(), (
        "run `python -m vehicle.simulator.firmware.header`"
    )


@pytest.mark.needs("gcc")
@pytest.mark.parametrize("stream", [flown, fuzzed])
@pytest.mark.parametrize("seed", [1])
def test_both_firmwares_answer_the_same(
    stream: Callable[[int, int], Iterator[Step]], seed: int
) -> None:
    python, in_c = Firmware(), NativeFirmware(2, "checked")
    for k, step in enumerate(stream(seed, 12_000)):
        assert answer(in_c, step) == answer(python, step), f"period {k} of seed {seed}: {step}"


@pytest.mark.needs("gcc", "simavr")
@pytest.mark.parametrize("stream", [flown, fuzzed])
def test_the_image_on_a_simulated_chip_sends_what_the_python_firmware_sends(
    stream: Callable[[int, int], Iterator[Step]],
) -> None:
    with chip.simulated_chip() as simulated:
        judged = judge(simulated, stream(3, 700))
    assert judged.different == ""
    assert judged.sent > 10_000
    assert judged.overruns == 0


@pytest.mark.needs("gcc", "simavr")
def test_the_image_fits_its_chip_with_room() -> None:
    with chip.simulated_chip() as simulated:
        judged = judge(simulated, fuzzed(4, 200))
    flash, ram = chip.sizes()
    assert flash <= chip.FLASH_MAX
    assert ram + judged.stack <= chip.RAM_MAX


REST = (512, 512, 512, 768, 410, 768, 512, 512)
"""Counts of the converter's channels of a level vehicle at rest."""
COMMAND = (0, 0, 0, 110)


def period(
    simulated: chip.Chip, line: bytes = b"", silent: int = 0, counts: tuple[int, ...] = REST
) -> chip.Output:
    return simulated.period(chip.Input(counts, silent, (line, b"")))


@pytest.mark.needs("gcc", "simavr")
def test_on_the_image_motors_stay_off_until_they_are_set_on_and_all_controllers_answer() -> None:
    on = c.encode_set(COMMAND, Id.MOTOR_STATE, MotorState.ON)
    command = c.encode_command(COMMAND)
    with chip.simulated_chip() as simulated:
        for _ in range(20):
            assert period(simulated, command).references == (0, 0, 0, 0)
        for k in range(20):
            told = period(simulated, on if k >= 10 else command, silent=0b0100)
        assert told.missing == 0b0100
        assert told.references == (0, 0, 0, 0)
        for _ in range(10):
            told = period(simulated, on)
        assert told.missing == 0
        assert min(told.references) > 50
        for _ in range(10):  # one reference lost to noise does not stop a motor
            told = period(simulated, command, silent=0b0001)
            assert told.missing == 0
            told = period(simulated, command)


@pytest.mark.needs("gcc", "simavr")
def test_the_watchdog_resets_an_image_that_hangs_in_flight_and_its_motors_stop() -> None:
    on = c.encode_set(COMMAND, Id.MOTOR_STATE, MotorState.ON)
    command = c.encode_command(COMMAND)
    with chip.simulated_chip() as simulated:
        for _ in range(10):
            period(simulated, command)
        for _ in range(10):
            told = period(simulated, on)
        assert min(told.references) > 50
        told = period(simulated, command, silent=chip.STOP_TIMER)
        assert told.cycles > 250_000, "the watchdog waits 15 ms"
        for _ in range(10):
            told = period(simulated, command)
        assert told.references == (0, 0, 0, 0)


@pytest.mark.needs("gcc", "simavr")
def test_after_each_change_of_the_period_the_image_has_new_readings() -> None:
    def changing() -> Iterator[Step]:
        for k in range(160):
            data = b""
            if k % 10 == 0:
                data = c.encode_set(COMMAND, Id.MIRROR_PERIOD, 1300 if k % 40 == 0 else 2000)
            inertial = (400 + (7 * k + 30 * axis) % 200 for axis in range(6))
            yield Step(16_000, 2 * k, 0, data, (*inertial, 150, 10_000))

    with chip.simulated_chip() as simulated:
        judged = judge(simulated, changing())
    assert judged.different == ""
    assert judged.sent > 2000


@pytest.mark.needs("gcc")
def test_a_vehicle_on_the_c_firmware_flies_as_one_on_the_python_firmware() -> None:
    ends = []
    for firmware in ("python", "c"):
        simulated = SimulatedVehicle(SimulatorParameters(firmware=firmware))
        for k in range(1000):
            command = (8, 252, 10, 125)  # pitch, roll, yaw rate, thrust
            data = c.encode_command(command) if k < 600 else b""  # in silence it lands by itself
            if k == 0:
                data = c.encode_set(command, Id.MOTOR_STATE, MotorState.ON)
            simulated.ports[0].write(data)
            simulated.step()
        assert simulated.firmware.motor_state is MotorState.EMERGENCY
        assert simulated.truth["position_w"][0, 2] > 0.3
        ends.append((simulated.truth.tobytes(), [port.read() for port in simulated.ports]))
    assert ends[0] == ends[1]


def test_without_a_compiler_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    native.library.cache_clear()
    with pytest.raises(StorageError, match="there is no make; it needs gcc and make, on Debian"):
        NativeFirmware()


@pytest.mark.parametrize("a", [0, 1, -1, 2**31 - 1, -(2**31), 123_456_789])
@pytest.mark.parametrize("b", [0, 1, -1, 32767, -32768])
def test_a_product_is_rounded_to_the_nearest(a: int, b: int) -> None:
    assert by16(a, b) == math.floor(a * b / 65536 + 0.5)


@pytest.mark.parametrize("square", [0, 1, 2, 3, 4, 65535, 65536, 10**9, 2**32 - 1])
def test_a_root_is_the_whole_part(square: int) -> None:
    assert root(square) == math.isqrt(square)


def test_angles_are_right_to_a_ten_thousandth_all_around() -> None:
    for k in range(720):
        turn = math.radians(0.5 * k - 180.0)
        y, x = round(16384 * math.sin(turn)), round(16384 * math.cos(turn))
        assert angle_of(y, x) / 2**15 == pytest.approx(math.atan2(y, x), abs=1e-4)
    assert angle_of(0, 0) == 0
    assert angle_of(0, -1) == HALF_TURN
