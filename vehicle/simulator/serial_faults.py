"""Faults of the serial lines: corrupted bytes, unplugged adapters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from vehicle.simulator.parameters import SimulatorParameters
from vehicle_link.serial.port import Port

_STREAM = 7
"""Stream of random numbers, separate from the sensors' noise with the same seed."""


class Line(Port, Protocol):
    """The microcontroller's end of a serial line whose other end is an adapter."""

    def unplug(self) -> None:
        """Unplug the adapter: the vehicle loses the line, and this end receives nothing."""

    def plug_in(self) -> None:
        """Plug it in again, as a new device."""


class Wire:
    """The microcontroller's end of one line, with faults.

    Attributes:
        share: 0..1, share of corrupted bytes, both ways; at 0 no random numbers are drawn.
    """

    def __init__(self, line: Line, generator: np.random.Generator) -> None:
        self.share = 0.0
        self._line = line
        self._generator = generator
        self._unplugged = False

    def read(self) -> bytes:
        data = self._line.read()
        return self._corrupted(data) if data and self.share else data

    def write(self, data: bytes) -> None:
        self._line.write(self._corrupted(data) if self.share else data)

    def be_unplugged(self, unplugged: bool) -> None:
        """Unplug the adapter or plug it in, unless that is already so."""
        if unplugged != self._unplugged:
            self._unplugged = unplugged
            (self._line.unplug if unplugged else self._line.plug_in)()

    def _corrupted(self, data: bytes) -> bytes:
        """Return the bytes as they arrive; a corrupted byte always differs from the original."""
        hit = self._generator.random(len(data)) < self.share
        if not hit.any():
            return data
        arrived = np.frombuffer(data, np.uint8).copy()
        arrived[hit] ^= self._generator.integers(1, 256, int(hit.sum()), np.uint8)
        return arrived.tobytes()


def new_wires(lines: Sequence[Line], parameters: SimulatorParameters) -> tuple[Wire, ...]:
    """Return the faults of the first and the second line."""
    generator = np.random.default_rng((parameters.seed, _STREAM))
    wires = tuple(Wire(line, generator) for line in lines)
    configure_wires(wires, parameters)
    return wires


def configure_wires(wires: Sequence[Wire], parameters: SimulatorParameters) -> None:
    """Apply the faults that the parameters specify."""
    for wire, unplugged in zip(wires, parameters.unplugged, strict=False):
        wire.share = parameters.corrupted_bytes
        wire.be_unplugged(unplugged)
