"""The microcontroller as the flight loop sees it: samples in, motor references out, no waiting.

It is first told what to mirror and to fly in direct mode, and asked who it is; samples count from
when it has confirmed what they contain, motors may be started once it is the right one. Every set
and request is repeated each 25 ms until answered, 40 times, then given up and reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec

from quadrotor.errors import LinkError
from vehicle.microcontroller_clock import MicrocontrollerClock
from vehicle_link.serial.commands import (
    VALUE,
    decode_data,
    decode_mirrored,
    decode_value,
    encode_command,
    encode_mirror,
    encode_request,
    encode_set,
)
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, PRESSURE_OFFSET, FlightControlMode, Id, MotorState
from vehicle_link.serial.port import Port

REPEAT_S = 0.025
TRIES = 40
SLOW_REPEAT_S = 1.0
"""What it must confirm before it may fly is asked on, for it may be switched on later."""
ROBOT_ID = 1
FIRMWARE_REVISION = 1

_MOTOR_STATES = tuple(MotorState)
_STOPPED = (0, 0, 0, 0)


class RawSample(msgspec.Struct, frozen=True, order=True):
    """One IMU sample as the sensors gave it; ordered by its stamp."""

    stamp_ns: int  # of the vehicle's clock
    accelerometer: tuple[int, int, int]  # counts, 0…1023, axes x, y, z
    gyroscope: tuple[int, int, int]  # counts, 0…1023
    battery_voltage: float  # V
    pressure: float  # Pa
    motor_state: MotorState


@dataclass(slots=True)
class _Request:
    """Something to repeat until it is answered."""

    key: int  # the id a reply names; _MIRROR_KEY for the list of mirrored ids
    expected: int | None  # value that settles it, None for any
    build: Callable[[Sequence[int]], bytes]
    name: str
    tries: int = 0
    due_s: float = -math.inf
    answer: str = "nothing"
    given_up: bool = False


_MIRROR_KEY = -1


class Microcontroller:
    """Both serial ports of one microcontroller.

    Args:
        ports: one or two; requests go to the first, references to all in turn.
        epoch_ns: time of the first sample; None takes the host's epoch time (see
            vehicle.microcontroller_clock).
        robot_id, firmware_revision: what it must be before motors may start.

    Attributes:
        failures: lines about sets and requests given up, for the caller to report and clear.
        refused: D frames with impossible values; late: samples dropped as older than the newest.
    """

    def __init__(
        self,
        ports: Sequence[Port],
        epoch_ns: int | None = None,
        *,
        robot_id: int = ROBOT_ID,
        firmware_revision: int = FIRMWARE_REVISION,
    ) -> None:
        if not 1 <= len(ports) <= 2:
            raise LinkError(f"{len(ports)} serial ports given; a microcontroller has one or two")
        self.failures: list[str] = []
        self.refused = 0
        self.late = 0
        self._ports = tuple(ports)
        self._decoders = tuple((port, FrameDecoder()) for port in ports)
        self._turn = 0
        self._clock = MicrocontrollerClock(epoch_ns)
        self._newest_ns = -1
        self._references: Sequence[int] = _STOPPED
        self._mirrored = False
        self._requests = [
            _Request(_MIRROR_KEY, None, lambda r: encode_mirror(r, MIRROR), "mirror the IMU"),
            _ask(Id.ROBOT_ID, robot_id),
            _ask(Id.FIRMWARE_REVISION, firmware_revision),
            _set(Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT),
        ]
        self._motors: _Request | None = None
        for request in self._requests:
            self._ports[0].write(request.build(_STOPPED))

    @property
    def connected(self) -> bool:
        """Whether it is the right microcontroller, mirrors the IMU and flies in direct mode."""
        return not self._requests

    @property
    def damaged(self) -> int:
        """Pieces of bytes, on all ports, that were not frames."""
        return sum(decoder.damaged for _, decoder in self._decoders)

    def filenos(self) -> tuple[int, ...]:
        """For poll(). Raises LinkError for ports in memory."""
        return tuple(port.fileno() for port in self._ports)

    def receive(self) -> list[RawSample]:
        """The samples that arrived, oldest first, each newer than all before.

        Raises LinkError when a port is gone.
        """
        samples: list[RawSample] = []
        settled = self._clock.settled
        for port, decoder in self._decoders:
            data = port.read()
            if data:
                for frame in decoder.feed(data):
                    values = decode_data(frame)
                    if values is None:
                        self._take_reply(frame)
                    elif self._mirrored:
                        sample = self._sample(values, settled)
                        if sample is not None:
                            samples.append(sample)
        if not settled:
            if samples:
                newest_ns = max(sample.stamp_ns for sample in samples)
                self._clock.settle(newest_ns, len(samples))
            return []
        if len(samples) == 1 and samples[0].stamp_ns > self._newest_ns:  # as a rule
            self._newest_ns = samples[0].stamp_ns
            return samples
        samples.sort()
        return self._in_order(samples)

    def command(self, references: Sequence[int]) -> None:
        """Send four motor references (counts, front, left, rear, right).

        Raises OutOfBoundsError or, when a port is gone, LinkError.
        """
        self._references = references
        self._ports[self._turn].write(encode_command(references))
        self._turn = (self._turn + 1) % len(self._ports)

    def set_motor_state(self, state: MotorState) -> None:
        """Ask for this motor state from the next `service` on, until it is echoed.

        Motors are switched on only once `connected`; any other state is asked for at once.
        """
        if state is not MotorState.ON:
            self._references = _STOPPED
        self._motors = _set(Id.MOTOR_STATE, state)

    def service(self, now_s: float) -> None:
        """Send and repeat what is due; `now_s` is any clock that does not go back."""
        for request in self._requests:
            self._repeat(request, now_s)
        if self._motors is not None:
            self._repeat(self._motors, now_s)

    # ------------------------------------------------------------------ parts
    def _sample(self, values: tuple[int, ...], settled: bool) -> RawSample | None:
        """A sample of the values of MIRROR; stamped by elapsed time until the clock is settled."""
        ms, a_x, a_y, a_z, g_x, g_y, g_z, battery, state, pressure = values
        if (a_x | a_y | a_z | g_x | g_y | g_z) & ~1023 or not 0 <= state <= 3 or battery < 0:
            self.refused += 1
            return None
        clock = self._clock
        elapsed_ns = clock.elapsed_ns(ms & 0xFFFF)
        if elapsed_ns is None:
            self.refused += 1
            return None
        return RawSample(
            clock.stamp_ns(elapsed_ns) if settled else elapsed_ns,
            (a_x, a_y, a_z),
            (g_x, g_y, g_z),
            battery * 0.1,
            float(pressure + PRESSURE_OFFSET),
            _MOTOR_STATES[state],
        )

    def _in_order(self, samples: list[RawSample]) -> list[RawSample]:
        kept = []
        for sample in samples:
            if sample.stamp_ns > self._newest_ns:
                self._newest_ns = sample.stamp_ns
                kept.append(sample)
            else:
                self.late += 1
        return kept

    def _repeat(self, request: _Request, now_s: float) -> None:
        """Send the request if it is due; report it once when all tries were in vain."""
        if now_s < request.due_s or request.given_up:
            return
        if request.tries == TRIES:
            request.given_up = request.key == Id.MOTOR_STATE and request.expected == MotorState.ON
            request.tries += 1
            self.failures.append(
                f"microcontroller: could not {request.name} in {TRIES} tries, "
                f"{TRIES * REPEAT_S:.1f} s; it answered {request.answer}. "
                "Check the cables, the ports and its firmware"
            )
            return
        request.tries += request.tries < TRIES
        request.due_s = now_s + (REPEAT_S if request.tries <= TRIES else SLOW_REPEAT_S)
        if request is self._motors and request.expected == MotorState.ON and not self.connected:
            request.answer = "nothing: it is not recognised yet"
            return
        self._ports[0].write(request.build(self._references))

    def _take_reply(self, frame: Frame) -> None:
        if frame.command == VALUE:
            reply = decode_value(frame)
            if reply is not None:
                self._settle(reply[0], reply[1], f"{reply[1]}")
            return
        ids = decode_mirrored(frame)
        if ids is not None:
            self._mirrored = ids == MIRROR
            if self._mirrored:
                self._settle(_MIRROR_KEY, None, "")

    def _settle(self, key: int, value: int | None, answer: str) -> None:
        for request in self._requests:
            if request.key == key:
                request.answer = answer
                if request.expected in (None, value):
                    self._requests.remove(request)
                    break
        motors = self._motors
        if motors is not None and key == motors.key:
            motors.answer = answer
            if motors.expected == value:
                self._motors = None


def _set(id: Id, value: int) -> _Request:
    name = f"set {id.name.lower()} to {value}"
    return _Request(id, value, lambda references: encode_set(references, id, value), name)


def _ask(id: Id, expected: int) -> _Request:
    name = f"confirm that {id.name.lower()} is {expected}"
    return _Request(id, expected, lambda references: encode_request(references, id), name)
