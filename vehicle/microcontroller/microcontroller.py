"""The microcontroller as the flight loop sees it: samples in, commands out, no waiting.

It is first told what to mirror, how often, and to fly in direct mode, and asked who it is; samples
count from when it has confirmed what they contain, motors may be started once it is the right one.
Every set and request is repeated each 25 ms until answered, 40 times, then given up and reported.

A command means another thing in another flight control mode. While a change of it is not echoed,
commands are sent as sets of the mode, which the microcontroller takes together: never are bytes of
one mode read in the other. A port that is gone is left out, as long as another one is there.

Bytes may arrive damaged. A command is repeated while no sample comes that would bring a new one,
but not for long; and as the checksum has 12 bits only, what a single sample says of the motors is
not believed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from vehicle.microcontroller.clock import MicrocontrollerClock
from vehicle.microcontroller.motor_bus import MotorBus
from vehicle.microcontroller.ports import MicrocontrollerPorts
from vehicle.microcontroller.sample_stamps import FineStamps
from vehicle_link.serial.capacity import DEFAULT_RATE, sample_period_us
from vehicle_link.serial.commands import decode_data, encode_command, encode_set
from vehicle_link.serial.exchange import (
    MIRROR_KEY,
    Exchange,
    confirm,
    decode_reply,
    mirror,
    set_value,
)
from vehicle_link.serial.frames import Frame
from vehicle_link.serial.identity import THE_ONE, Identity
from vehicle_link.serial.ids import MIRROR, PRESSURE_OFFSET, FlightControlMode, Id, MotorState
from vehicle_link.serial.port import Port

REPEAT_COMMAND_S = 0.006
KEEP_COMMAND_S = 0.04
"""Since the tick that made it: an old command must not keep the microcontroller from landing."""

_MOTOR_STATES = tuple(MotorState)
_MODES = frozenset(FlightControlMode)
_RESTING = (MotorState.INIT, MotorState.OFF)
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
    """A microcontroller behind one or both of its serial ports.

    Args:
        ports: one or two; requests go to the first, references to all in turn.
        epoch_ns: time of the first sample; None takes the host's epoch time (see
            vehicle.microcontroller.clock).
        rate: IMU samples a second to ask for; motors do not start before it is confirmed.
        identity: what it must be before motors may start.

    Attributes:
        failures: lines about sets and requests given up, ports that are gone and clocks that were
            set, for the caller to report and clear.
        flight_control_mode: what the microcontroller has confirmed last.
        refused: D frames with impossible values or times; late: samples dropped as older than the
            newest.
        newest_ms: of the D frame read last from each port, the microcontroller's time; -1 before.
    """

    def __init__(
        self,
        ports: Sequence[Port],
        epoch_ns: int | None = None,
        *,
        rate: int = DEFAULT_RATE,
        identity: Identity = THE_ONE,
    ) -> None:
        self.failures: list[str] = []
        self.refused = 0
        self.late = 0
        self.flight_control_mode = FlightControlMode.NEAR_HOVERING  # as at power-up
        self.newest_ms = [-1] * len(ports)
        self._ports = MicrocontrollerPorts(ports, self.failures)
        self._clock = MicrocontrollerClock(epoch_ns)
        self._newest_ns = -1
        period_us = sample_period_us(rate)
        self._stamps = FineStamps(1000 * period_us)
        self._command: Sequence[int] = _STOPPED
        self._mode = FlightControlMode.DIRECT  # of the command
        self._is_new = False  # the command, since the last service
        self._made_s = self._sent_s = -math.inf  # when the command was made, and sent last
        self._mirrored = False
        self._motor_state, self._motor_state_read = 0, -1
        self._handshake = Exchange(
            [
                mirror(MIRROR),
                set_value(Id.MIRROR_PERIOD, period_us),
                confirm(Id.ROBOT_ID, identity.robot_id),
                confirm(Id.FIRMWARE_REVISION, identity.firmware),
                set_value(Id.FLIGHT_CONTROL_MODE, FlightControlMode.DIRECT),
            ],
            self.failures,
        )
        self._motors = Exchange([], self.failures)
        self._bus = MotorBus()
        for request in self._handshake.open:
            self._ports.write(request.build(_STOPPED))

    @property
    def connected(self) -> bool:
        """Return whether it is the right microcontroller, mirrors the IMU and flies in direct
        mode.
        """
        return not self._handshake.open

    @property
    def obstacle(self) -> str:
        """Return why motors would not start, as far as is known; empty when they would."""
        if not self._handshake.open:
            return self._bus.why
        waiting = self._handshake.open[0]
        return (
            f"the microcontroller is not recognised: could not yet {waiting.name}, {waiting.told}"
        )

    @property
    def damaged(self) -> int:
        """Return pieces of bytes, on all ports, that were not frames."""
        return self._ports.damaged

    @property
    def lost_ports(self) -> int:
        """Return how many ports are gone."""
        return self._ports.lost

    def filenos(self) -> tuple[int, ...]:
        """Return the file descriptors for poll(). Raises LinkError for ports in memory."""
        return self._ports.filenos()

    def receive(self) -> list[RawSample]:
        """Return the samples that arrived, oldest first, each newer than all before.

        Raises LinkError when the last port is gone.
        """
        samples: list[RawSample] = []
        settled = self._clock.settled
        for frame in self._ports.read():
            values = decode_data(frame)
            if values is None:
                self._take_reply(frame)
                continue
            self.newest_ms[self._ports.reading] = values[0] & 0xFFFF
            if self._mirrored:
                sample = self._sample(values, settled)
                if sample is not None:
                    samples.append(sample)
        if not settled:
            if samples:
                newest_ns = max(sample.stamp_ns for sample in samples)
                self._clock.settle(newest_ns, len(samples))
            return []
        if samples and self._motor_state_read in _RESTING:
            self._correct_clock(max(sample.stamp_ns for sample in samples))
        if len(samples) == 1 and samples[0].stamp_ns > self._newest_ns:  # as a rule
            self._newest_ns = samples[0].stamp_ns
            samples[0] = self._refined(samples[0])
            return samples
        samples.sort()
        return self._in_order(samples)

    def command(
        self, command: Sequence[int], mode: FlightControlMode = FlightControlMode.DIRECT
    ) -> None:
        """Send the four command bytes (0…255) of a flight control mode, and change to it.

        In direct mode they are motor references (counts, front, left, rear, right), else those of
        vehicle_link.serial.attitude_command.

        Raises OutOfBoundsError or, when the last port is gone, LinkError.
        """
        self._command, self._mode, self._is_new = command, mode, True
        self._send_command()

    def set_motor_state(self, state: MotorState) -> None:
        """Ask for this motor state from the next `service` on, until it is echoed.

        Motors are switched on only once `connected`; any other state is asked for at once.
        """
        if state is not MotorState.ON:
            self._command, self._is_new, self._made_s = _STOPPED, False, -math.inf
        self._motors.put(set_value(Id.MOTOR_STATE, state, persistent=state is not MotorState.ON))

    def set_value(self, id: Id, value: int) -> None:
        """Ask for this value of an id from the next `service` on, until it is echoed."""
        self._motors.put(set_value(id, value))

    def service(self, now_s: float) -> None:
        """Send and repeat what is due; `now_s` is any clock that does not go back."""
        for frame in self._handshake.service(now_s, self._command):
            self._ports.write(frame)
        for request in self._motors.open:
            starting = request.key == Id.MOTOR_STATE and request.expected == MotorState.ON
            request.hold = "it is not recognised yet" if starting and not self.connected else ""
        for frame in self._motors.service(now_s, self._command):
            self._ports.write(frame)
        # As samples tell it: none, and no one knows.
        rests = self._motor_state_read in _RESTING
        if rests and self.connected and all(one.given_up for one in self._motors.open):
            question = self._bus.question(now_s, self._command)
            if question is not None:
                self._ports.write(question)
        if self._is_new:
            self._is_new = False
            self._made_s = self._sent_s = now_s
        elif now_s - self._made_s < KEEP_COMMAND_S and now_s - self._sent_s > REPEAT_COMMAND_S:
            self._sent_s = now_s
            self._send_command()

    # ------------------------------------------------------------------ parts
    def _send_command(self) -> None:
        if self._mode is self.flight_control_mode:
            frame = encode_command(self._command)
        else:
            frame = encode_set(self._command, Id.FLIGHT_CONTROL_MODE, self._mode)
        self._ports.write(frame, in_turn=True)

    def _sample(self, values: tuple[int, ...], settled: bool) -> RawSample | None:
        """Return a sample of the values of MIRROR; stamped by elapsed time until the clock is
        settled.
        """
        ms, a_x, a_y, a_z, g_x, g_y, g_z, battery, state, pressure = values
        if (a_x | a_y | a_z | g_x | g_y | g_z) & ~1023 or not 0 <= state <= 3 or battery < 0:
            self.refused += 1
            return None
        clock = self._clock
        elapsed_ns = clock.elapsed_ns(ms & 0xFFFF)
        if elapsed_ns is None:
            self.refused += 1
            return None
        if self._motor_state_read in (state, -1):
            self._motor_state = state
        self._motor_state_read = state
        return RawSample(
            clock.stamp_ns(elapsed_ns) if settled else elapsed_ns,
            (a_x, a_y, a_z),
            (g_x, g_y, g_z),
            battery * 0.1,
            float(pressure + PRESSURE_OFFSET),
            _MOTOR_STATES[self._motor_state],
        )

    def _correct_clock(self, newest_ns: int) -> None:
        """Correct the clock; samples of the time it was ahead by are dropped, as time does not go
        back.
        """
        ahead = self._clock.correct(newest_ns - self._clock.stamp_ns(0))
        if ahead:
            self.failures.append(f"the vehicle's clock was {ahead * 1e3:.0f} ms ahead; set back")
        if moved := self._clock.host_set():
            self.failures.append(
                f"the clock of the vehicle's computer was set {'forward' if moved > 0 else 'back'} "
                f"by {abs(moved):.1f} s; the vehicle's clock, and so the date of its logs, stays "
                "as it was until `quadlab vehicle` is started again"
            )

    def _in_order(self, samples: list[RawSample]) -> list[RawSample]:
        kept = []
        for sample in samples:
            if sample.stamp_ns > self._newest_ns:
                self._newest_ns = sample.stamp_ns
                kept.append(self._refined(sample))
            else:
                self.late += 1
        return kept

    def _refined(self, sample: RawSample) -> RawSample:
        stamp_ns = self._stamps.refine(sample.stamp_ns)
        if stamp_ns == sample.stamp_ns:  # always, at a period of whole milliseconds
            return sample
        return msgspec.structs.replace(sample, stamp_ns=stamp_ns)

    def _take_reply(self, frame: Frame) -> None:
        reply = decode_reply(frame)
        if reply is None:
            return
        key, answer = reply
        if key == MIRROR_KEY:
            self._mirrored = answer == MIRROR
        elif key == Id.FLIGHT_CONTROL_MODE and answer in _MODES:
            self.flight_control_mode = FlightControlMode(answer)
        self._handshake.settle(key, answer)
        self._motors.settle(key, answer)
        line = self._bus.take(key, answer)
        if line is not None:
            self.failures.append(line)
