"""The search for microcontrollers behind serial devices: all are queried at once, in one poll loop.

At first a device is only listened to: where a microcontroller reports running motors nothing is
sent, because every frame to it carries a command. The others are asked for robot id, firmware
revision and time. Two ports belong to one microcontroller if their clocks agree. (Two
microcontrollers switched on within some 50 ms of each other look like one.)
"""

from __future__ import annotations

import math
import select
import time
from collections import deque
from collections.abc import Sequence
from enum import Enum

import msgspec

from quadrotor.motor_state import MotorState
from vehicle_link.serial.commands import decode_data, decode_instruction, encode_request
from vehicle_link.serial.exchange import REPEAT_S, TRIES, Exchange, ask, decode_reply
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, TIME_PERIOD_MS, Id
from vehicle_link.serial.port import BAUD_RATE, PortError
from vehicle_link.serial.serial_port import SerialPort
from vehicle_link.serial.values import QUANTITIES

LISTEN_S = 0.1
LIMIT_S = LISTEN_S + TRIES * REPEAT_S
"""Time limit for all devices together."""
STALE_MS = 50
"""Largest age, in ms, of the time in an answer: it may be that of the last sample, or the
microcontroller was busy."""
CLOCK_QUESTIONS = 6
_POLL_MS = 5
_STOPPED = (0, 0, 0, 0)
_IDENTITY = (Id.ROBOT_ID, Id.FIRMWARE_REVISION)
_WHAT_TIME = encode_request(_STOPPED, Id.TIME)


class Finding(Enum):
    """The kinds of result of a search behind one device."""

    FOUND = "the expected microcontroller"
    OTHER_ROBOT = "another robot's microcontroller"
    OTHER_FIRMWARE = "a microcontroller with another firmware"
    RUNNING = "a microcontroller with running motors"
    SILENT = "nothing received"
    GARBAGE = "bytes that are not frames"
    DEAF = "frames, but no answers"
    ECHO = "our own bytes"
    MISSING = "no such device"
    BUSY = "open elsewhere"
    FORBIDDEN = "permission denied"
    NOT_SERIAL = "not a serial device"
    FAILED = "cannot be opened"
    UNPLUGGED = "was unplugged or hung up"


class Clock(msgspec.Struct, frozen=True):
    """Bounds of a microcontroller's time minus this host's, in ms.

    An answer's time is never later than its arrival. Of its age it is only assumed that the best of
    several answers is older than its question by at most STALE_MS.
    """

    low: float = -math.inf
    high: float = -math.inf

    def updated(self, value_ms: int, asked_s: float, answered_s: float) -> Clock:
        """Return the clock narrowed by one more answer; bounds are modulo 60 s, near these."""
        low, high = value_ms - 1e3 * answered_s, value_ms - 1e3 * asked_s + STALE_MS
        if math.isfinite(self.low):
            turns = TIME_PERIOD_MS * round((self.low - low) / TIME_PERIOD_MS)
            low, high = low + turns, high + turns
        return Clock(max(low, self.low), max(high, self.high))

    def agrees(self, other: Clock) -> bool:
        """Return whether both may be the same clock."""
        low, high = self.low - other.high, self.high - other.low
        return TIME_PERIOD_MS * math.floor(high / TIME_PERIOD_MS) >= low


class Device(msgspec.Struct, frozen=True):
    """The result of the search behind one device."""

    path: str
    finding: Finding
    text: str  # one line about it, without its path
    robot_id: int | None = None
    firmware: int | None = None
    clock: Clock | None = None

    @property
    def line(self) -> str:
        return f"{self.path}: {self.text}"

    def is_of(self, other: Device) -> bool:
        """Return whether both are ports of one microcontroller."""
        return (
            self.clock is not None
            and other.clock is not None
            and (self.robot_id, self.firmware) == (other.robot_id, other.firmware)
            and self.clock.agrees(other.clock)
        )


def discover(
    paths: Sequence[str], *, robot_id: int, firmware: int, limit_s: float = LIMIT_S
) -> list[Device]:
    """Open every device that can be opened, query all at once, and close them again.

    Never raises because of a device; takes at most about `limit_s`.
    """
    probes = [_Probe(path) for path in paths]
    try:
        _ask_all(probes, limit_s)
    finally:
        for probe in probes:
            probe.close()
    return [probe.device(robot_id, firmware, limit_s) for probe in probes]


def _ask_all(probes: Sequence[_Probe], limit_s: float) -> None:
    begun_s = time.monotonic()
    while (now_s := time.monotonic()) - begun_s < limit_s:
        waiting = {probe.fileno(): probe for probe in probes if not probe.done}
        if not waiting:
            return
        poll = select.poll()
        for descriptor, probe in waiting.items():
            if now_s - begun_s >= LISTEN_S:
                probe.service(now_s)
            poll.register(descriptor, select.POLLIN)
        for descriptor, _ in poll.poll(_POLL_MS):
            waiting[descriptor].read()


class _Probe:
    """One device while it is being queried."""

    def __init__(self, path: str) -> None:
        self.path = path
        self._port: SerialPort | None = None
        self._problem: PortError | None = None
        self._decoder = FrameDecoder()
        self._exchange = Exchange([ask(Id.ROBOT_ID), ask(Id.FIRMWARE_REVISION), ask(Id.TIME)])
        self._answers: dict[int, int] = {}
        self._clock = Clock()
        self._asked_s: deque[float] = deque()  # when the questions for the time were sent
        self._questions = 0
        self._bytes = self._frames = 0
        self._echo = self._running = False
        try:
            self._port = SerialPort(path)
        except PortError as error:
            self._problem = error

    @property
    def done(self) -> bool:
        """Return whether nothing more can be learnt."""
        return self._problem is not None or self._running or not self._exchange.open

    def fileno(self) -> int:
        assert self._port is not None
        return self._port.fileno()

    def service(self, now_s: float) -> None:
        """Send the questions that are due."""
        frames = self._exchange.service(now_s, _STOPPED)
        if self._port is None or self.done:
            return
        try:
            for frame in frames:
                if frame == _WHAT_TIME:
                    self._asked_s.append(now_s)
                self._port.write(frame)
        except PortError as error:
            self._problem = error

    def read(self) -> None:
        """Process the bytes that have arrived."""
        assert self._port is not None
        try:
            data = self._port.read()
        except PortError as error:
            self._problem = error
            return
        self._bytes += len(data)
        for frame in self._decoder.feed(data):
            self._frames += 1
            self._take(frame)

    def close(self) -> None:
        if self._port is not None:
            self._port.close()

    def _take(self, frame: Frame) -> None:
        self._echo = self._echo or decode_instruction(frame) is not None
        values = decode_data(frame)
        if values is not None:
            self._running = self._running or _motors_run(values)
            return
        reply = decode_reply(frame)
        if reply is None:
            return
        id, value = reply
        if not isinstance(value, int):
            return
        if id == Id.TIME and self._asked_s:
            # Answers keep their order; if one was lost, bounds of an earlier question are wider.
            asked_s = self._asked_s.popleft()
            self._clock = self._clock.updated(value & 0xFFFF, asked_s, time.monotonic())
            self._questions += 1
        if self._exchange.settle(id, value) is None:
            return
        self._answers[id] = value
        if id == Id.TIME and self._questions < CLOCK_QUESTIONS:
            self._exchange.put(ask(Id.TIME))

    # ------------------------------------------------------------------ the result
    def device(self, robot_id: int, firmware: int, limit_s: float) -> Device:
        """Return the result of the search behind this device."""
        finding, text = self._judge(robot_id, firmware, limit_s)
        known = self._questions > 0
        robot, revision = (self._answers.get(id) for id in _IDENTITY)
        return Device(self.path, finding, text, robot, revision, self._clock if known else None)

    def _judge(self, robot_id: int, firmware: int, limit_s: float) -> tuple[Finding, str]:
        if self._problem is not None:
            return Finding[self._problem.problem.name], self._problem.why
        if self._running:
            return Finding.RUNNING, (
                "its motors are running, so it was not queried: a query carries a command; "
                "end what flies it first"
            )
        if all(id in self._answers for id in _IDENTITY):
            return self._identify(robot_id, firmware)
        if self._answers:
            answers = ", ".join(f"{Id(id).name.lower()} {v}" for id, v in self._answers.items())
            return (
                Finding.DEAF,
                f"stopped answering after {answers}; check its cables and its supply",
            )
        if self._echo:
            return Finding.ECHO, (
                "gives back what is sent: its two lines touch, or it is another kind of device"
            )
        if self._frames > self._decoder.damaged:
            return Finding.DEAF, (
                f"sends frames but did not answer in {limit_s:.1f} s; "
                "check the line towards the microcontroller"
            )
        if self._bytes:
            return Finding.GARBAGE, (
                f"{self._bytes} bytes with {self._frames} whole frames in them; "
                f"its baud rate is not {BAUD_RATE}, "
                "or it is another kind of device"
            )
        return Finding.SILENT, (
            f"silent for {limit_s:.1f} s; is the microcontroller switched on, "
            "and are both lines connected?"
        )

    def _identify(self, robot_id: int, firmware: int) -> tuple[Finding, str]:
        found_id, found_firmware = (self._answers[id] for id in _IDENTITY)
        text = f"robot {found_id}, firmware {found_firmware}"
        if found_id != robot_id:
            return Finding.OTHER_ROBOT, (
                f"{text}; expected is robot {robot_id}: give its ports, "
                f"or fly this one with --robot-id {found_id}"
            )
        if found_firmware != firmware:
            return Finding.OTHER_FIRMWARE, (
                f"{text}; expected is firmware {firmware}: install that one, "
                f"or fly with --firmware {found_firmware} if you know that it speaks the same"
            )
        return Finding.FOUND, text


def _motors_run(values: tuple[int, ...]) -> bool:
    """Return whether this is a sample with quadlab's mirrored ids in which motors turn."""
    sample = dict(zip(MIRROR, values, strict=True))
    for id, value in sample.items():
        low, high = QUANTITIES[id].bounds
        if not low <= (value if QUANTITIES[id].signed else value % 65536) <= high:
            return False
    return sample[Id.MOTOR_STATE] in (MotorState.ON, MotorState.EMERGENCY)
