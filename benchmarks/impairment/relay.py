"""The process between the two ends: it reads what one end sends and writes it to the other.

`python -m benchmarks.impairment.relay A B CONTROL SEED`: descriptors of the two devices and of a
datagram socket over which conditions are changed and counters requested, and the seed.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import select
import socket
import sys
import time
from typing import Any

from benchmarks.impairment.wire import Conditions, Wire

LARGEST = 65_536
PRIORITY = 60
"""SCHED_FIFO priority if allowed, above the flight processes: a late relay is a slow link."""
LONGEST_WAIT = 0.5


class Relay:
    """Relay with wire 0 from A to B and wire 1 back."""

    def __init__(self, devices: tuple[int, int], control: socket.socket, seed: int) -> None:
        self._devices = devices
        self._control = control
        self._wires = (Wire(Conditions(), seed), Wire(Conditions(), seed + 1))

    def run(self) -> None:
        """Relay until the control socket is closed."""
        poll = select.poll()
        for descriptor in (*self._devices, self._control.fileno()):
            poll.register(descriptor, select.POLLIN)
        while True:
            now = time.monotonic()
            for k, wire in enumerate(self._wires):
                for packet in wire.due(now):
                    with contextlib.suppress(OSError):  # its device is full: the packet is lost
                        os.write(self._devices[1 - k], packet)
            arrival = min(wire.next_arrival for wire in self._wires)
            wait = min(LONGEST_WAIT, max(0.0, arrival - time.monotonic()))
            for descriptor, _ in poll.poll(wait * 1e3):
                if descriptor == self._control.fileno():
                    if not self._obey():
                        return
                else:
                    self._read(self._devices.index(descriptor))

    def _read(self, end: int) -> None:
        while True:
            try:
                packet = os.read(self._devices[end], LARGEST)
            except BlockingIOError:
                return
            self._wires[end].offer(packet, time.monotonic())

    def _obey(self) -> bool:
        data = self._control.recv(LARGEST)
        if not data:
            return False
        order: dict[str, Any] = json.loads(data)
        for wire in self._wires:
            if "conditions" in order:
                wire.change(Conditions(**order["conditions"]))
            if "interrupt" in order:
                wire.interrupt(time.monotonic(), order["interrupt"])
        counts = [[w.sent, w.lost, w.overflowed, w.bytes] for w in self._wires]
        self._control.send(json.dumps(counts).encode())
        return True


def main() -> None:
    first, second, control, seed = (int(word) for word in sys.argv[1:5])
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    gc.disable()
    with socket.socket(fileno=control) as orders:
        Relay((first, second), orders, seed).run()


if __name__ == "__main__":
    main()
