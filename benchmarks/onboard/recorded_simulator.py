"""The simulator process, noting when each sample was taken and each command reached the motors.

    python -m benchmarks.onboard.recorded_simulator FOLDER OUT TRUTH

Otherwise it is `quadlab simulator --folder FOLDER`, except for the truth, which is written to the
file descriptor TRUTH instead of the station. OUT is an .npz, written at its end.
"""

from __future__ import annotations

import os
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np

from vehicle.simulator import process, robot, simulated_vehicle
from vehicle.simulator.firmware.firmware import Firmware
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.simulator.truth import Put
from vehicle_link.serial.commands import COMMAND, Instruction

CAPACITY = 400_000
HEADER = struct.Struct("<qI")
"""Header of each message of the truth: its stamp (ns) and its length."""


class Notes:
    """Two tables; times in ns, of the microcontroller's clock and of the host's steady one."""

    def __init__(self) -> None:
        self.samples = np.zeros((CAPACITY, 2), np.int64)
        self.commands = np.zeros((CAPACITY, 3), np.int64)  # port first
        self.sample_count = self.command_count = 0
        self.port = 0
        self.arrived: list[int] = []  # ports of the commands that the next period executes


class RecordedFirmware(Firmware):
    """Firmware that notes samples sent and whole commands received."""

    notes = Notes()

    def receive(self, port: int, data: bytes) -> bytes:
        self.notes.port = port
        return super().receive(port, data)

    def next_data(self) -> tuple[int, bytes]:
        notes = self.notes
        if notes.sample_count < CAPACITY:
            notes.samples[notes.sample_count] = self._ms * 1_000_000, time.monotonic_ns()
            notes.sample_count += 1
        return super().next_data()

    def _obey(self, instruction: Instruction) -> bytes:
        if instruction.kind == COMMAND:
            self.notes.arrived.append(self.notes.port)
        return super()._obey(instruction)


class RecordedVehicle(SimulatedVehicle):
    """Vehicle that notes when a command's references reach the motors' bus: after the step."""

    def step_periods(self, most: int) -> None:
        super().step_periods(most)
        notes = RecordedFirmware.notes
        if notes.arrived:
            now_ns = time.monotonic_ns()
            for port in notes.arrived:
                if notes.command_count < CAPACITY:
                    notes.commands[notes.command_count] = port, self.stamp_ns, now_ns
                    notes.command_count += 1
            notes.arrived.clear()


def main() -> int:
    """Run until a signal."""
    folder, out, truth = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    notes = RecordedFirmware.notes

    def connect(*_: object) -> Callable[[], tuple[Put, Callable[[], None]]]:
        def put(payload: bytes, stamp_ns: int, topic: str = "truth", /) -> None:
            assert topic == "truth", "no motor is turned on the bench here"
            os.write(truth, HEADER.pack(stamp_ns, len(payload)) + payload)

        return lambda: (put, lambda: None)

    with (
        mock.patch.object(robot, "connect_to_station", connect),
        mock.patch.object(robot, "SimulatedVehicle", RecordedVehicle),
        mock.patch.object(simulated_vehicle, "Firmware", RecordedFirmware),
    ):
        statistics = process.run(SimulatorParameters(), folder, 0)
    np.savez(
        out,
        samples=notes.samples[: notes.sample_count],
        commands=notes.commands[: notes.command_count],
        lost=np.array([statistics.lost_samples, statistics.dropped_bytes, statistics.overruns]),
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
