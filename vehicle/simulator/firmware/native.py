"""The C firmware, built for this computer by gcc, with the interface of the Python one."""

from __future__ import annotations

import ctypes
import subprocess
from functools import cache

import numpy as np
import numpy.typing as npt

from quadrotor.checkout import ROOT
from quadrotor.errors import StorageError
from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware.firmware import REGISTERS
from vehicle_link.serial.ids import Id

FOLDER = ROOT / "firmware"
_ROOM = 34
"""Size, in bytes, of the longest frame that it sends."""


@cache
def library(target: str = "native") -> ctypes.CDLL:
    """Return the firmware as a shared object, built first if its sources changed.

    Args:
        target: `native`, or `checked`, which traps integer overflows.

    Raises StorageError when it cannot be built.
    """
    try:
        made = subprocess.run(
            ["make", "--silent", "-C", FOLDER, target], capture_output=True, text=True, check=False
        )
    except FileNotFoundError:
        made = subprocess.CompletedProcess([], 127, "", "there is no make")
    if made.returncode:
        said = (made.stderr.strip() or "make failed").splitlines()
        raise StorageError(
            f"the C firmware cannot be built: {said[0]}; it needs gcc and make, on Debian: "
            "apt install gcc make. The Python firmware needs no compiler"
        )
    name = "firmware.so" if target == "native" else f"firmware_{target}.so"
    found = ctypes.CDLL(str(FOLDER / "build" / name))
    found.native_size.restype = found.native_receive.restype = ctypes.c_size_t
    found.firmware_data.restype = ctypes.c_uint8
    return found


class NativeFirmware:
    """One microcontroller that runs the C firmware, with the interface of `firmware.Firmware`.

    Attributes:
        registers: (65,) int16, by Id; the C firmware's own memory.
    """

    def __init__(self, ports: int = 2, target: str = "native") -> None:
        self._c = library(target)
        self._memory = ctypes.create_string_buffer(self._c.native_size())
        self._frame = ctypes.create_string_buffer(_ROOM)
        self._driven = (ctypes.c_uint8 * 8)()
        self._c.native_begin(self._memory, ports)
        self.registers: npt.NDArray[np.int16] = np.frombuffer(
            memoryview(self._memory), np.int16, REGISTERS
        )

    @property
    def motor_state(self) -> MotorState:
        return MotorState(int(self.registers[Id.MOTOR_STATE]))

    @property
    def references(self) -> tuple[int, ...]:
        """Return motor references (counts) on the motors' bus."""
        return self._driving()[:4]

    @property
    def command(self) -> tuple[int, int, int, int]:
        """Return the four bytes of the newest command, all 0 unless the motors are on."""
        _, _, _, _, a, b, c, d = self._driving()
        return a, b, c, d

    def _driving(self) -> tuple[int, ...]:
        self._c.native_driven(self._memory, self._driven)
        return tuple(self._driven)

    def receive(self, port: int, data: bytes) -> bytes:
        """Process bytes from one line and return the replies to send on it."""
        replies = ctypes.create_string_buffer(2 * len(data) + _ROOM)
        size = self._c.native_receive(self._memory, port, data, ctypes.c_size_t(len(data)), replies)
        return replies.raw[:size]

    def advance(self, elapsed_ms: int) -> None:
        """Set the time since power-up; check whether an emergency begins or ends."""
        self._c.firmware_advance(self._memory, ctypes.c_uint32(elapsed_ms))

    def period(self, command: tuple[int, int, int, int]) -> None:
        """Run estimation, then control, with the registers' sensors and the bytes of a command."""
        self._c.firmware_period(self._memory, bytes(command))

    def next_data(self) -> tuple[int, bytes]:
        """Return (port, `D` frame) of the present registers; the lines alternate."""
        port: int = self._c.firmware_data(self._memory, self._frame)
        return port, self._frame.raw

    def steps(self, ms: int, count: int, step_ms: int) -> None:
        """Count periods of estimation and control, each `step_ms` long at most."""
        self._c.native_steps(self._memory, ctypes.c_uint32(ms), count, step_ms)

    def set_period(self, sixteenths: int) -> None:
        """Set the gains for a period in 1/16 us."""
        self._c.native_set_period(self._memory, sixteenths)

    def set_missing(self, motors: int) -> None:
        """Set the bits of the motors whose controllers do not answer."""
        self._c.native_set_missing(self._memory, motors)
