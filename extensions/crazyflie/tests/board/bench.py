"""A simulated Crazyflie at rest on a table, without a plant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from extensions.crazyflie.board.board import CrazyflieBoard
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.crtp.packets import Packet
from extensions.crazyflie.simulated.firmware import CrazyflieFirmware
from vehicle.boards.board import RawSample
from vehicle.simulator.parameters import SimulatorParameters
from vehicle_link.serial.port import memory_port_pair


class RestingCrazyflie(CrazyflieFirmware):
    """A simulated Crazyflie that lies level and still, with a battery of 4.1 V."""

    def __init__(self, protocol: int | None = None) -> None:
        super().__init__()
        self.guard = None
        self._protocol = protocol
        self._sensors = np.zeros(1, [("voltage", "f8")])
        self._sensors["voltage"] = 16.4
        self._sensed[0] = 0.0, 0.0, 9.81
        self._pressure = 96000.0
        self.taken: list[Packet] = []

    def _take(self, packet: Packet) -> None:
        self.taken.append(packet)
        if self._protocol is not None and (packet.port, packet.channel) == (13, 1):
            self._send(Packet(13, 1, bytes((packet.data[0], self._protocol))))
            return
        super()._take(packet)


class Bench:
    """A board with its Crazyflie; each step is a millisecond."""

    def __init__(
        self,
        options: CrazyflieOptions | None = None,
        *,
        protocol: int | None = None,
        is_passive: bool = False,
        delay: float = 0.004,
        loss: float = 0.0,
    ) -> None:
        self.now_ms = 0
        self.firmware = RestingCrazyflie(protocol)
        self.firmware.configure(SimulatorParameters(radio_delay=delay, radio_loss=loss))
        near, self.far = memory_port_pair()
        self.board = CrazyflieBoard(
            [near],
            options or CrazyflieOptions(),
            now_ns=lambda: 1_000_000 * self.now_ms,
            is_passive=is_passive,
        )

    def go(self, steps: int, each: Callable[[], object] = lambda: None) -> list[RawSample]:
        samples = []
        for _ in range(steps):
            self.now_ms += 1
            self.firmware.receive(0, self.far.read())
            self.firmware.period((0, 0, 0, 0))
            self.far.write(self.firmware.next_data()[1])
            samples += self.board.receive()
            self.board.service(1e-3 * self.now_ms)
            each()
        return samples
