"""The microcontroller's own statistics, updated each second (ids 34…39, 51 and 53)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from vehicle_link.serial.ids import Id

SECOND_MS = 1000
LONGEST = 32767


class Statistics:
    """Counter of commands, packets and periods; writes its results into `registers` (65,)."""

    def __init__(self, registers: npt.NDArray[np.int16]) -> None:
        self._registers = registers
        self._began_ms = 0
        self._commands = self._packets = self._second_packets = self._steps = 0
        self._command_ms = self._packet_ms = 0
        self._command_gap = self._packet_gap = self._longest_step = 0

    def command(self, ms: int) -> None:
        """Count a frame that carried a command."""
        self._commands += 1
        self._command_gap = max(self._command_gap, ms - self._command_ms)
        self._command_ms = ms

    def packet(self, port: int, ms: int) -> None:
        """Count a `D` frame that was sent on this port."""
        self._packets += 1
        self._second_packets += port == 1
        self._packet_gap = max(self._packet_gap, ms - self._packet_ms)
        self._packet_ms = ms

    def steps(self, ms: int, count: int, step_ms: int) -> None:
        """Count periods of estimation and control, each `step_ms` long at most."""
        self._steps += count
        self._longest_step = max(self._longest_step, step_ms)
        if ms - self._began_ms >= SECOND_MS:
            self._publish(ms)

    def _publish(self, ms: int) -> None:
        duration = ms - self._began_ms
        # A gap that has not ended counts with its length so far.
        for id, value in (
            (Id.COMMANDS_PER_SECOND, _a_second(self._commands, duration)),
            (Id.LONGEST_COMMAND_GAP, max(self._command_gap, ms - self._command_ms)),
            (Id.PACKETS_PER_SECOND, _a_second(self._packets, duration)),
            (Id.LONGEST_PACKET_GAP, max(self._packet_gap, ms - self._packet_ms)),
            (Id.CONTROL_STEPS_PER_SECOND, _a_second(self._steps, duration)),
            (Id.LONGEST_CONTROL_PERIOD, self._longest_step),
            (Id.ESTIMATION_STEPS_PER_SECOND, _a_second(self._steps, duration)),
            (Id.SECOND_SERIAL_PACKETS_PER_SECOND, _a_second(self._second_packets, duration)),
        ):
            self._registers[id] = min(LONGEST, value)
        self._began_ms = ms
        self._commands = self._packets = self._second_packets = self._steps = 0
        self._command_gap = self._packet_gap = self._longest_step = 0


def _a_second(count: int, duration_ms: int) -> int:
    """Return the rate per second of `count` events in a duration, rounded."""
    return (2 * SECOND_MS * count + duration_ms) // (2 * duration_ms)
