"""The firmware's image on a simulated ATmega1284P: simavr, driven by `firmware/judge/harness.c`."""

from __future__ import annotations

import shutil
import struct
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from vehicle.simulator.firmware.native import FOLDER

FLASH_MAX, RAM_MAX = 48 * 1024, 8 * 1024
"""Largest flash and RAM of the firmware, in bytes."""
CYCLES_PER_US = 20
NEEDS = ("make", "gcc", "avr-gcc", "simavr")
STOP_TIMER = 0x80
"""Bit of `Input.silent` that stops the period's timer, as a fault of the chip would."""
_HEAD, _TOLD = struct.Struct("<8HB"), struct.Struct("<B2s4s3I")


def missing() -> str:
    """Return why the chip cannot be simulated on this machine, empty when it can."""
    absent = [tool for tool in NEEDS if shutil.which(tool) is None]
    if not absent:
        return ""
    packages = "make gcc gcc-avr avr-libc simavr libsimavr-dev"
    return f"no {', '.join(absent)}: on Debian, apt install {packages}"


@dataclass(frozen=True, slots=True)
class Input:
    """The input of the chip during one of its periods."""

    counts: tuple[int, ...]  # of the converter's channels, for the next period
    silent: int  # bits of the motor controllers that do not answer
    lines: tuple[bytes, bytes]


@dataclass(frozen=True, slots=True)
class Output:
    """The output of the chip during one of its periods, and its load.

    Attributes:
        passed: periods that passed since the last; 1 unless one took too long.
        missing: bits of the motors that counted as missing.
        taken: bytes of each line that it took.
        references: what the bus carried last to the motors front, left, rear, right.
        awake, cycles: cycles of work, and in all.
        stack: largest stack so far, bytes.
    """

    passed: int
    missing: int
    taken: tuple[int, ...]
    references: tuple[int, ...]
    awake: int
    cycles: int
    stack: int
    lines: tuple[bytes, bytes]


class Chip:
    """One simulated microcontroller that runs the image."""

    def __init__(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        self._in, self._out = process.stdin, process.stdout

    def period(self, given: Input) -> Output:
        """Run one period of the chip, to the end of its work."""
        lines = b"".join(bytes([len(line)]) + line for line in given.lines)
        self._in.write(_HEAD.pack(*given.counts, given.silent) + lines)
        self._in.flush()
        began, taken, references, awake, cycles, stack = _TOLD.unpack(self._out.read(_TOLD.size))
        sent = self._out.read(self._out.read(1)[0]), self._out.read(self._out.read(1)[0])
        return Output(
            (began >> 4) & 7,
            began & 15,
            tuple(taken),
            tuple(references),
            awake,
            cycles,
            stack,
            sent,
        )


@contextmanager
def simulated_chip() -> Iterator[Chip]:
    """Build image and harness, and run them."""
    subprocess.run(["make", "--silent", "-C", FOLDER, "judged"], check=True)
    image = str(FOLDER / "build" / "image.elf")
    told = subprocess.run(["avr-nm", image], capture_output=True, text=True, check=True).stdout
    at = {words[-1]: words[0] for words in map(str.split, told.splitlines())}
    words = [str(FOLDER / "build" / "harness"), image, at["_end"]]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        yield Chip(process)
        assert process.stdin is not None
        process.stdin.close()


def sizes() -> tuple[int, int]:
    """Return the bytes of flash and of static RAM of the image."""
    words = ["avr-size", str(FOLDER / "build" / "image.elf")]
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    text, data, bss = (int(word) for word in told.splitlines()[1].split()[:3])
    return text + data, data + bss
