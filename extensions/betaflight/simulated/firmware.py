"""The real Betaflight firmware behind the interface of the simulated microcontroller."""

from __future__ import annotations

from extensions.betaflight.board.configuration import mode_lines, required
from extensions.betaflight.board.messages import Function
from extensions.betaflight.board.options import BetaflightOptions
from extensions.betaflight.msp.frames import REPLY, encode
from extensions.betaflight.simulated.process import BetaflightProcess
from vehicle.simulator.board_firmware import PERIOD_US, BoardFirmware

BYTES = 64
"""Largest number of bytes sent at once, so that a late reader loses nothing of a long answer."""
_ANALOG = encode(Function.ANALOG, bytes(9), REPLY)[:8]
_VOLTAGE_AT = 7
FRAME = (
    "mixer QUADP",
    "set ap_altitude_d = 40",
    *(f"set {name}_roll = {value}" for name, value in (("p", 18), ("i", 0), ("d", 0), ("f", 0))),
    *(f"set {name}_pitch = {value}" for name, value in (("p", 18), ("i", 0), ("d", 0), ("f", 0))),
    *(f"set {name}_yaw = {value}" for name, value in (("p", 90), ("i", 0), ("f", 0))),
)
"""Lines that a person enters for this vehicle: its mixer, the damping of its own landing, and gains
near `control.attitude.kw`."""


class BetaflightFirmware(BoardFirmware):
    """One board with Betaflight in a process."""

    def __init__(self, options: BetaflightOptions) -> None:
        super().__init__()
        settings = required(options).items()
        lines = [f"set {name} = {value}" for name, value in settings]
        self._process = BetaflightProcess([*lines, *mode_lines(), *FRAME, "save"])
        self._unsent = b""

    def period(self, command: tuple[int, int, int, int]) -> None:
        assert self._plant is not None
        force, rates = self._sensed.tolist()
        quaternion = self._plant["x"][0, 6:10].tolist()
        self._turn(self._process.step(1000 * PERIOD_US, rates, force, quaternion, self._pressure))

    def receive(self, port: int, data: bytes) -> bytes:
        self._process.port.write(data)
        return b""

    def next_data(self) -> tuple[int, bytes]:
        data = self._process.port.read()
        self._unsent += self._with_battery(data) if _ANALOG in data else data
        sent, self._unsent = self._unsent[:BYTES], self._unsent[BYTES:]
        return 0, sent

    def _with_battery(self, data: bytes) -> bytes:
        """Return the bytes with the plant's voltage; this firmware target has no meter."""
        before, after = data.split(_ANALOG, 1)
        voltage = round(100.0 * self.voltage)
        payload = after[:_VOLTAGE_AT] + voltage.to_bytes(2, "little")
        return before + encode(Function.ANALOG, payload, REPLY) + after[len(payload) + 1 :]

    def fail(self) -> None:
        self._process.kill()

    def close(self) -> None:
        self._process.close()
