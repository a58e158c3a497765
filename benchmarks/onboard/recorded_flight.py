"""The vehicle's flight process, noting when each tick began and each command was written.

    python -m benchmarks.onboard.recorded_flight CONFIG OUT

Otherwise it is `python -m vehicle.flight.process CONFIG`. OUT is an .npz, written at its end.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec
import numpy as np

from vehicle.boards.board import RawSample
from vehicle.flight import process as flight
from vehicle.flight.loop import FlightLoop
from vehicle.processes.config import VehicleConfig
from vehicle.simulator.in_process import InProcessRobot

CAPACITY = 400_000
_COMMAND = b"#bb"


class RecordedLoop(FlightLoop):
    """Loop that notes times into arrays made before the first tick, to allocate none in flight."""

    out = Path()

    def __init__(self, stack: Any, mcu: Any, *arguments: Any, **words: Any) -> None:
        super().__init__(stack, mcu, *arguments, **words)
        self._microcontroller = mcu
        self._ticks = np.zeros((CAPACITY, 4), np.int64)  # sample's stamp, due, began, ended
        self._commands = np.zeros((CAPACITY, 2), np.int64)  # port, stamp of the tick's sample
        self._tick_count = self._command_count = 0
        self._stamp_ns = 0
        for port, _, index in mcu._ports._ports:
            port.write = self._noting(index, port.write)

    def run(self) -> None:
        try:
            super().run()
        finally:
            clock = self._microcontroller._clock
            np.savez(
                self.out,
                ticks=self._ticks[: self._tick_count],
                commands=self._commands[: self._command_count],
                clock=np.array([clock._epoch_ns or 0, clock._elapsed_ms, clock._last_ms or 0]),
                counts=np.array(
                    [self.counts.overruns, self._deadlines.missed, self._microcontroller.damaged]
                ),
            )

    def _tick(self, sample: RawSample, began_ns: int) -> int:
        self._stamp_ns = sample.stamp_ns
        ended_ns = super()._tick(sample, began_ns)
        if self._tick_count < CAPACITY:
            due_ns = getattr(self._pacer, "due_ns", 0)
            self._ticks[self._tick_count] = sample.stamp_ns, due_ns, began_ns, ended_ns
            self._tick_count += 1
        return ended_ns

    def _noting(self, index: int, write: Callable[[bytes], None]) -> Callable[[bytes], None]:
        def noting(data: bytes) -> None:
            if data.startswith(_COMMAND) and self._command_count < CAPACITY:
                self._commands[self._command_count] = index, self._stamp_ns
                self._command_count += 1
            write(data)

        return noting


def main() -> int:
    """Run the process; return the exit status of vehicle.flight.process."""
    RecordedLoop.out = Path(sys.argv[2])
    has_ports = bool(msgspec.json.decode(sys.argv[1], type=VehicleConfig).ports)
    with mock.patch.object(flight, "FlightLoop", RecordedLoop):
        return flight.main(sys.argv[1], None if has_ports else InProcessRobot)


if __name__ == "__main__":
    sys.exit(main())
