"""The microcontroller as the flight loop sees it: samples in, motor references out, no waiting.

It is first told what to mirror and to fly in direct mode, and asked who it is; samples count from
when it has confirmed what they contain, motors may be started once it is the right one. Every set
and request is repeated each 25 ms until answered, 40 times, then given up and reported.
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from quadrotor.errors import LinkError
from vehicle.microcontroller_clock import MicrocontrollerClock
from vehicle_link.serial.commands import decode_data, encode_command
from vehicle_link.serial.exchange import (
    MIRROR_KEY,
    Exchange,
    confirm,
    decode_reply,
    mirror,
    set_value,
)
from vehicle_link.serial.frames import Frame, FrameDecoder
from vehicle_link.serial.ids import MIRROR, PRESSURE_OFFSET, FlightControlMode, Id, MotorState
from vehicle_link.serial.port import Port

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
        self._handshake = Exchange(
            [
                mirror(MIRROR),
                confirm(Id.ROBOT_ID, robot_id),
                confirm(Id.FIRMWARE_REVISION, firmware_revision),
                set_value(Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT),
            ],
            self.failures,
        )
        self._motors = Exchange([], self.failures)
        for request in self._handshake.open:
            self._ports[0].write(request.build(_STOPPED))

    @property
    def connected(self) -> bool:
        """Whether it is the right microcontroller, mirrors the IMU and flies in direct mode."""
        return not self._handshake.open

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
        self._motors.put(set_value(Id.MOTOR_STATE, state, persistent=state is not MotorState.ON))

    def service(self, now_s: float) -> None:
        """Send and repeat what is due; `now_s` is any clock that does not go back."""
        for frame in self._handshake.service(now_s, self._references):
            self._ports[0].write(frame)
        for request in self._motors.open:
            starting = request.expected == MotorState.ON and not self.connected
            request.hold = "it is not recognised yet" if starting else ""
        for frame in self._motors.service(now_s, self._references):
            self._ports[0].write(frame)

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

    def _take_reply(self, frame: Frame) -> None:
        reply = decode_reply(frame)
        if reply is None:
            return
        key, answer = reply
        if key == MIRROR_KEY:
            self._mirrored = answer == MIRROR
        self._handshake.settle(key, answer)
        self._motors.settle(key, answer)
