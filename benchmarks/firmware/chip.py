"""The firmware's core on a simulated ATmega1284P: simavr, driven by `firmware/avr/harness.c`."""

from __future__ import annotations

import shutil
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from benchmarks.firmware.streams import Answer, Step
from vehicle.simulator.firmware.native import FOLDER

BUDGET = 20_000_000 // 500
"""Number of cycles in a control period at 500 Hz."""
FLASH_MAX, RAM_MAX = 48 * 1024, 8 * 1024
"""Largest flash and RAM of the firmware, in bytes."""
NEEDS = ("make", "gcc", "avr-gcc", "simavr")
_TOLD = struct.Struct("<B34s4s130s4I")


def missing() -> str:
    """Return why the chip cannot be simulated on this machine, empty when it can."""
    absent = [tool for tool in NEEDS if shutil.which(tool) is None]
    if not absent:
        return ""
    packages = "make gcc gcc-avr avr-libc simavr libsimavr-dev"
    return f"no {', '.join(absent)}: on Debian, apt install {packages}"


@dataclass(frozen=True, slots=True)
class Cost:
    """Cycles of one step, and the largest stack so far, in bytes."""

    receiving: int
    period: int
    sending: int
    stack: int

    @property
    def cycles(self) -> int:
        return self.receiving + self.period + self.sending


class Chip:
    """One simulated microcontroller that runs the core."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        self._in, self._out = process.stdin, process.stdout

    def answer(self, step: Step) -> tuple[Answer, Cost]:
        """Return the chip's answer to one step, and its cost."""
        self._in.write(step.encode())
        self._in.flush()
        replies = self._out.read(int.from_bytes(self._out.read(2), "little"))
        port, data, references, registers, *cost = _TOLD.unpack(self._out.read(_TOLD.size))
        return (replies, port, data, tuple(references), registers), Cost(*cost)


@contextmanager
def simulated_chip() -> Iterator[Chip]:
    """Build image and harness, and run them."""
    subprocess.run(["make", "--silent", "-C", FOLDER, "judged"], check=True)
    image = str(FOLDER / "build" / "judged.elf")
    told = subprocess.run(["avr-nm", image], capture_output=True, text=True, check=True).stdout
    at = {words[-1]: words[0] for words in map(str.split, told.splitlines())}
    words = [str(FOLDER / "build" / "harness"), image, at["mailbox"], at["firmware"], at["_end"]]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        yield Chip(process)
        assert process.stdin is not None
        process.stdin.close()


def sizes(image: str) -> tuple[int, int]:
    """Return the bytes of flash and of static RAM of an image."""
    words = ["avr-size", str(FOLDER / "build" / image)]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    text, data, bss = (int(word) for word in told.splitlines()[1].split()[:3])
    return text + data, data + bss
