"""Periods of the microcontroller, with the plant moving in between."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from quadrotor.compiled import compiled, direct
from quadrotor.records import Record
from quadrotor.vehicle_model import Four
from vehicle.simulator.air import blow
from vehicle.simulator.board_firmware import BoardFirmware
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.firmware.native import NativeFirmware
from vehicle.simulator.firmware.program import period
from vehicle.simulator.held_vehicle import FREE, configure_holder, hold, new_holder
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import advance
from vehicle.simulator.sensors import GUSTS, sample, sense

Command = tuple[int, int, int, int]
"""The four bytes of a command."""
World = tuple[Record, Record, npt.NDArray[np.float64]]
"""PLANT (1,), SENSORS (1,) and the block of random numbers."""
STOPPED = (0, 0, 0, 0)


@compiled
def move(
    plant: Record,
    sensors: Record,
    noise: npt.NDArray[np.float64],
    row: int,
    registers: npt.NDArray[np.int16],
    references: Four,
    holder: Record,
    dt: float,
) -> None:
    """Advance the plant by one period, dt (s), and sample it."""
    blow(plant, noise[:, GUSTS:], row, dt)
    if holder[0].held == FREE:
        advance(plant, references, dt)
    else:
        hold(plant, holder, references, dt)
    sample(plant, sensors, noise, row, registers)


@compiled
def _run_python(
    plant: Record,
    sensors: Record,
    noise: npt.NDArray[np.float64],
    program: Record,
    registers: npt.NDArray[np.int16],
    holder: Record,
    row: int,
    command: tuple[int, int, int, int],
    periods: int,
    dt: float,
) -> None:
    """Run `periods` of the microcontroller, `dt` (s) each, with the plant advancing in between."""
    p = program[0]
    for k in range(periods):
        r = p.references
        move(
            plant,
            sensors,
            noise,
            row + k,
            registers,
            (r[0], r[1], r[2], r[3]),
            holder=holder,
            dt=dt,
        )
        period(p, registers, command)


def runner(
    firmware: Firmware | NativeFirmware | BoardFirmware, world: World, holder: Record
) -> Callable[[int, Command, int, float], None]:
    """Return the function that runs a firmware from this row of the random numbers on, with this
    command, for this number of periods, each that long (s).
    """
    if isinstance(firmware, Firmware):
        of = *world, firmware.program, firmware.registers, holder
        machine = direct(_run_python, *of, 0, STOPPED, 1, 0.001)
        return lambda row, command, periods, dt: machine(*of, row, command, periods, dt)

    def run(row: int, command: Command, periods: int, dt: float) -> None:
        for k in range(row, row + periods):
            a, b, c, d = firmware.references
            move(*world, k, firmware.registers, (a, b, c, d), holder, dt)
            if isinstance(firmware, BoardFirmware):
                firmware.sense(*world, k)
            firmware.period(command)

    return run


def compile_periods(world: World, dt: float, fine: bool) -> None:
    """Compile the functions that `run` calls, on copies of the world.

    Args:
        fine: whether for a board with finer sensors than the paper's.
    """
    firmware, holder = Firmware(), new_holder()
    registers = firmware.registers
    sample(*world, 0, registers)
    firmware.period(STOPPED)
    move(*world, 0, registers, STOPPED, holder, dt)
    if fine:
        move(*world, 0, registers, (0.0, 0.0, 0.0, 0.0), holder, dt)
        sense(*world, 0, np.zeros((2, 3)))
    for held in ("hand", "free", "bench"):
        configure_holder(holder, world[0], SimulatorParameters(held=held))
