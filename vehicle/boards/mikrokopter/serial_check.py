"""The quality of a connection to the microcontroller, measured for a second (`--check`).

Nothing is switched on: the check requests the microcontroller's identity, lets it mirror the IMU,
polls the motor controllers, and requests the battery voltage repeatedly.
"""

from __future__ import annotations

import select
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from quadrotor.errors import LinkError
from vehicle.boards.imu import ImuCalibration
from vehicle.boards.mikrokopter.motor_bus import REFERENCES, MotorBus
from vehicle.realtime import RealTime, become_real_time
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.serial.commands import decode_data, encode_request
from vehicle_link.serial.devices import PATIENCE_S, await_devices
from vehicle_link.serial.discovery import Device, Finding
from vehicle_link.serial.exchange import Answer, Exchange, ask, decode_reply, mirror
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, Id
from vehicle_link.serial.serial_port import SerialPort
from vehicle_link.serial.values import to_si

MEASURED_S = 1.0
ANSWERS_LIMIT_S = 1.0
QUESTION_PERIOD_S = 0.02
"""Period, in s, of the requests on each port; the answers take little of the line's capacity."""
ANSWER_LIMIT_S = 0.1
"""Seconds after which a request without an answer counts as lost."""
DAMAGED_MAX = 0.01
"""Largest share of damaged frames; more means a bad cable."""
LOST_MAX = 0.05
"""Largest share of lost requests."""
DEVIATION_MAX = 1.0
"""deg/s, largest deviation of a gyroscope at rest."""
RATE_MIN = 100.0
"""IMU samples a second, over all ports; the controller is designed for 500."""
_POLL_MS = 5
_STOPPED = (0, 0, 0, 0)
_GYROSCOPE = slice(MIRROR.index(Id.GYROSCOPE_X), MIRROR.index(Id.GYROSCOPE_Z) + 1)

Say = Callable[[str], None]


def check_connection(
    paths: Sequence[str],
    *,
    identity: Identity = THE_ONE,
    patience_s: float = PATIENCE_S,
    say: Say = print,
    ask_for_real_time: Callable[[], RealTime] = become_real_time,
) -> bool:
    """Report line by line what is connected to one or two ports and how well it works.

    Returns whether all is good. A port that fails during the check is reported as one of the lines.
    """
    devices = await_devices(
        paths,
        robot_id=identity.robot_id,
        firmware=identity.firmware,
        patience_s=patience_s,
        say=say,
    )
    for device in devices:
        good = device.finding is Finding.FOUND
        say(f"{device.line}{_relation(device, devices)}" if good else f"not good: {device.line}")
    if not all(device.finding is Finding.FOUND for device in devices):
        return False
    problems = _two_controllers(devices)
    if not problems:
        real_time = ask_for_real_time()
        try:
            lines, motors = _measure(paths)
        except LinkError as error:
            problems = [str(error)]
        else:
            problems = _report(lines, say) + _report_motors(*motors, say)
        say(real_time.refusal or "real time: SCHED_FIFO granted, memory locked")
    for problem in problems:
        say(f"not good: {problem}")
    if not problems:
        say("good")
    return not problems


def _relation(device: Device, devices: Sequence[Device]) -> str:
    first = devices[0]
    return f", the same as {first.path}" if device is not first and device.is_of(first) else ""


def _two_controllers(devices: Sequence[Device]) -> list[str]:
    if all(device.is_of(devices[0]) for device in devices):
        return []
    return [
        f"{' and '.join(device.path for device in devices)} are two microcontrollers of one "
        "robot id: their clocks differ; give the two ports of one"
    ]


@dataclass(slots=True)
class _Line:
    """One port during the measurement."""

    port: SerialPort
    decoder: FrameDecoder = field(default_factory=FrameDecoder)
    frames: int = 0
    samples: int = 0
    gyroscope: list[tuple[int, ...]] = field(default_factory=list)  # counts
    round_trips_s: list[float] = field(default_factory=list)
    due_s: float = 0.0
    asked_s: float | None = None
    asked: int = 0
    battery: int | None = None

    def request(self, now_s: float) -> None:
        """Send one request at a time, the next one when it is answered or lost."""
        lost = self.asked_s is not None and now_s - self.asked_s > ANSWER_LIMIT_S
        if now_s >= self.due_s and (self.asked_s is None or lost):
            self.asked_s, self.due_s = now_s, now_s + QUESTION_PERIOD_S
            self.asked += 1
            self.port.write(encode_request(_STOPPED, Id.BATTERY))

    def receive(self, frame: Frame) -> None:
        self.frames += 1
        values = decode_data(frame)
        if values is not None:
            self.samples += 1
            self.gyroscope.append(values[_GYROSCOPE])
            return
        reply = decode_reply(frame)
        if reply is not None and reply[0] == Id.BATTERY and isinstance(reply[1], int):
            self.battery = reply[1]
            if self.asked_s is not None:
                self.round_trips_s.append(time.monotonic() - self.asked_s)
                self.asked_s = None


def _measure(paths: Sequence[str]) -> tuple[list[_Line], tuple[int, str]]:
    """Return the lines, and the result of `_look_at_motors`.

    Raises LinkError when a port is lost or the mirror is not confirmed.
    """
    lines: list[_Line] = []
    try:
        for path in paths:
            lines.append(_Line(SerialPort(path)))
        _choose_mirror(lines)
        motors = _look_at_motors(lines)
        for line in lines:  # exclude earlier bytes
            line.frames = line.decoder.damaged = 0
        deadline_s = time.monotonic() + MEASURED_S
        while (now_s := time.monotonic()) < deadline_s:
            for line in lines:
                line.request(now_s)
            for line, frame in _receive(lines):
                line.receive(frame)
    finally:
        for line in lines:
            line.port.close()
    return lines, motors


def _choose_mirror(lines: Sequence[_Line]) -> None:
    exchange = Exchange([mirror(MIRROR)])
    _until_answered(lines, exchange, lambda key, answer: None)
    if exchange.open:
        raise LinkError("it did not confirm what to mirror; check its firmware")


def _look_at_motors(lines: Sequence[_Line]) -> tuple[int, str]:
    """Return the number of motors that answered, and what is wrong with their controllers."""
    bus, exchange = MotorBus(), Exchange([ask(id) for id in REFERENCES])
    _until_answered(lines, exchange, bus.receive)
    return len(REFERENCES) - len(exchange.open), bus.why


def _until_answered(
    lines: Sequence[_Line], exchange: Exchange, take: Callable[[int, Answer], object]
) -> None:
    """Send requests on the first port, for ANSWERS_LIMIT_S at most."""
    deadline_s = time.monotonic() + ANSWERS_LIMIT_S
    while exchange.open and (now_s := time.monotonic()) < deadline_s:
        for frame in exchange.service(now_s, _STOPPED):
            lines[0].port.write(frame)
        for _, received in _receive(lines):
            reply = decode_reply(received)
            if reply is not None:
                take(*reply)
                exchange.settle(*reply)


def _receive(lines: Sequence[_Line]) -> list[tuple[_Line, Frame]]:
    ready = select.select([line.port for line in lines], [], [], _POLL_MS * 1e-3)[0]
    return [
        (line, frame)
        for line in lines
        if line.port in ready
        for frame in line.decoder.feed(line.port.read())
    ]


# ---------------------------------------------------------------- results
def _report(lines: Sequence[_Line], say: Say) -> list[str]:
    """Report the figures, and return the problems."""
    problems = []
    batteries = [line.battery for line in lines if line.battery is not None]
    if batteries:
        say(f"battery {to_si(Id.BATTERY, batteries[-1]):.1f} V")
    rates = [line.samples / MEASURED_S for line in lines]
    each = ", ".join(f"{r:.0f} on {x.port.path}" for r, x in zip(rates, lines, strict=True))
    say(f"IMU samples a second: {each}; {sum(rates):.0f} together")
    if sum(rates) < RATE_MIN:
        problems.append(
            f"{sum(rates):.0f} IMU samples a second; at least {RATE_MIN:.0f} are needed"
        )
    silent = [line.port.path for line in lines if not line.samples]
    if silent and sum(rates):
        problems.append(f"no sample on {', '.join(silent)}; is its line from the robot connected?")
    frames, damaged = sum(x.frames for x in lines), sum(x.decoder.damaged for x in lines)
    say(f"damaged frames: {damaged} of {frames + damaged}")
    if damaged > DAMAGED_MAX * (frames + damaged):
        problems.append(
            f"{damaged} of {frames + damaged} frames damaged, allowed is 1 %; "
            "check plugs, ground and length of the cable"
        )
    problems += _report_round_trips(lines, say)
    _report_gyroscope(lines, say)
    return problems


def _report_motors(answered: int, why: str, say: Say) -> list[str]:
    if why:
        return [why]
    if answered < len(REFERENCES):
        return [f"{answered} of {len(REFERENCES)} motors were reported; try again"]
    say("motor controllers: all four answer")
    return []


def _report_round_trips(lines: Sequence[_Line], say: Say) -> list[str]:
    trips = [1e3 * trip for line in lines for trip in line.round_trips_s]
    asked = sum(line.asked for line in lines) - sum(line.asked_s is not None for line in lines)
    if not trips:
        return ["no request was answered; check the lines to the microcontroller"]
    say(
        f"round trip of a request: {statistics.median(trips):.1f} ms p50, {max(trips):.1f} ms "
        f"at most; {len(trips)} of {max(asked, len(trips))} answered"
    )
    if asked - len(trips) > LOST_MAX * asked:
        return [f"{asked - len(trips)} of {asked} requests lost; check the cables"]
    return []


def _report_gyroscope(lines: Sequence[_Line], say: Say) -> None:
    counts = np.array([values for line in lines for values in line.gyroscope], np.float64)
    if not len(counts):
        return
    nominal = ImuCalibration()
    rates = nominal.gyroscope_scale * (counts - nominal.gyroscope_zero)
    mean, deviation = rates.mean(axis=0), rates.std(axis=0).max()
    moved = "" if deviation <= DEVIATION_MAX else f", more than {DEVIATION_MAX:g}: was it moved?"
    say(
        f"gyroscope x, y, z: mean {mean[0]:.2f}, {mean[1]:.2f}, {mean[2]:.2f} °/s, "
        f"deviation {deviation:.2f} °/s{moved}"
    )
