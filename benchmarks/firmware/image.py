"""The image on the simulated chip compared with the Python firmware, period by period."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from benchmarks.firmware.chip import Chip, Input, Output
from benchmarks.firmware.streams import SENSORS, Step
from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware.firmware import Firmware
from vehicle_link.serial.ids import Id

SAMPLE_US = 2000
"""Period of the `D` frames at power-up, us."""
_CHANNELS = (7, 6, 5, 1, 2, 0, 4, 3)
"""Channel of each of SENSORS, as in `firmware/board/wiring.h`."""
_AT_REST = 768  # count of the pressure: near the upper end of its range
_PASCALS = 1000 / 578  # per count
_QUIET = 60
"""Periods without new bytes at the end, in which what waits leaves."""
_FRAME = 34
"""Bytes of a `D` frame; the newest of each line is still on its way."""


class PressureRange:
    """Meaning of the analog pressure sensor's readings, and how the image moves their range."""

    def __init__(self) -> None:
        self.coarse, self.fine = 199, 127
        self._moved_ms = 0

    def reading(self, count: int) -> int:
        """Return Pa - 90000."""
        bias = 60 * (self.fine + 1) + 120 * (self.coarse + 1)
        return min(32767, (count * 28_346 >> 14) + bias + 67_100 - 90_000)

    def find(self, count: int, ms: int) -> None:
        """Move the range, at most every 0.3 s, by whole steps of the coarse or the fine output."""
        if ms - self._moved_ms < 300 or 500 <= count <= 950:
            return
        self._moved_ms = ms
        if int((count - 768) / 69):
            self.coarse = min(255, max(0, self.coarse + int((count - 768) / 69)))
        else:
            self.fine = min(255, max(0, self.fine + int((count - 768) / 35)))


@dataclass(slots=True)
class Judgement:
    """Comparison of a run on the chip with the Python firmware.

    Attributes:
        periods: periods run.
        different: what differed first, empty when nothing did.
        sent: bytes that left on both lines, all compared.
        overruns: periods that began late.
        shares: the chip's load in each period: cycles awake over those in all.
        stack: largest stack, bytes.
    """

    periods: int = 0
    different: str = ""
    sent: int = 0
    overruns: int = 0
    shares: list[float] = field(default_factory=list)
    stack: int = 0


class Twin:
    """The Python firmware, run as the image's board layer runs the C one."""

    def __init__(self) -> None:
        self.firmware = Firmware()
        self.firmware.registers[Id.MIRROR_PERIOD] = SAMPLE_US
        self.pressure = PressureRange()
        self._waiting = [b"", b""]
        self._counts: tuple[int, ...] = ()  # read by the next period
        self._us = 0
        self._pace()

    def _pace(self) -> None:
        self._sample_us = int(self.firmware.registers[Id.MIRROR_PERIOD])
        self._periods = self._left = -(-self._sample_us // 2000)
        self._period_us = self._sample_us // self._periods
        self.firmware.set_period(16 * self._period_us)

    def period(self, given: Input, told: Output) -> list[bytes]:
        """Return what must leave on each line, with the bytes that the chip took in this period."""
        firmware, counts = self.firmware, self._counts or given.counts
        self._counts = given.counts
        self._us += told.passed * self._period_us
        ms = self._us // 1000
        firmware.set_missing(told.missing)
        firmware.advance(ms)
        out = [b"", b""]
        for port, count in enumerate(told.taken):
            data = self._waiting[port] + given.lines[port]
            self._waiting[port] = data[count:]
            out[port] = firmware.receive(port, data[:count])
        for id, channel in zip(SENSORS, _CHANNELS, strict=True):
            firmware.registers[id] = counts[channel]
        firmware.registers[Id.BATTERY] = counts[4] * 6007 + 0x2000 >> 14
        firmware.registers[Id.PRESSURE] = self.pressure.reading(counts[3])
        if firmware.motor_state in (MotorState.INIT, MotorState.OFF):
            self.pressure.find(counts[3], ms)
        firmware.period(firmware.command)
        firmware.steps(ms, told.passed, told.passed * (1 if self._period_us < 1500 else 2))
        self._left -= 1
        if self._left == 0:
            self._left = self._periods
            port, frame = firmware.next_data()
            out[port] += frame
        if firmware.registers[Id.MIRROR_PERIOD] != self._sample_us:
            self._pace()
        return out


def inputs(steps: Iterable[Step]) -> Iterator[Input]:
    """Yield steps as the chip's pins carry them, and quiet periods at the end."""
    given, rest = Input((512,) * 8, 0, (b"", b"")), 0
    for k, step in enumerate(steps):
        *inertial, battery, pressure = step.sensors
        rest = pressure if k == 0 else rest
        sensors = (*inertial, battery * 30 // 11, round((pressure - rest) / _PASCALS) + _AT_REST)
        counts = [0] * 8
        for channel, count in zip(_CHANNELS, sensors, strict=True):
            counts[channel] = min(1023, max(0, count))
        lines = (step.data, b"") if step.port == 0 else (b"", step.data)
        given = Input(tuple(counts), step.missing, lines)
        yield given
    for _ in range(_QUIET):
        yield Input(given.counts, given.silent, (b"", b""))


def judge(chip: Chip, steps: Iterable[Step]) -> Judgement:
    """Run both on the same input, and compare every byte on the lines and on the bus."""
    twin, judgement = Twin(), Judgement()
    expected: list[list[bytes]] = [[], []]
    sent: list[list[bytes]] = [[], []]
    before: tuple[int, ...] = (0, 0, 0, 0)
    silent = 0  # in the last period: these motors keep an older reference
    for given in inputs(steps):
        told = chip.period(given)
        judgement.periods += 1
        for port, out in enumerate(twin.period(given, told)):
            expected[port].append(out)
            sent[port].append(told.lines[port])
        # The bus carries a period's references while and after its work ends.
        now = twin.firmware.references
        carried = all(
            reference in pair for reference, *pair in zip(told.references, before, now, strict=True)
        )
        is_judged = not (told.missing or given.silent or silent)
        silent = given.silent
        if not carried and is_judged and not judgement.different:
            judgement.different = (
                f"period {judgement.periods}: {told.references} on the bus instead of {before} "
                f"or {now}"
            )
        before = now
        judgement.overruns += told.passed - 1
        judgement.shares.append(told.awake / told.cycles)
        judgement.stack = told.stack
    for port in (0, 1):
        should, did = b"".join(expected[port]), b"".join(sent[port])
        judgement.sent += len(did)
        on_its_way = len(should) - len(did)
        if not (should.startswith(did) and on_its_way <= 2 * _FRAME):
            at = next((i for i, (a, b) in enumerate(zip(should, did, strict=False)) if a != b), -1)
            judgement.different = judgement.different or (
                f"line {port}, byte {at} of {len(did)}: {did[at : at + 34]!r} instead of "
                f"{should[at : at + 34]!r}"
            )
    return judgement
