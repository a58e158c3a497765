"""The flight loop's interface to the microcontroller: samples in, commands out, non-blocking.

It first sets what to mirror, how often, and direct mode, and requests the identity; samples are
used once their content is confirmed, and motors may be started once the identity matches.
Every set and request is retried each 25 ms, 40 times, until answered, then given up and reported.

The meaning of a command depends on the flight control mode. Until a change of mode is echoed,
commands are sent together with a set of the mode, so that the bytes of one mode are never read in
the other. A lost port is ignored as long as the other one works.

Bytes may arrive damaged. The last command is repeated for a short time while no sample arrives
that would trigger a new one. As the checksum has only 12 bits, the motor state in a single sample
is not trusted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from quadrotor.errors import OutOfBoundsError
from quadrotor.motor_state import MotorState
from quadrotor.parameters import Parameters
from vehicle.boards.board import Command, CommandKind, RawSample, Traits
from vehicle.boards.kind import Kind
from vehicle.boards.mikrokopter.clock import FRAME_NS, MicrocontrollerClock
from vehicle.boards.mikrokopter.motor_bus import MotorBus
from vehicle.boards.mikrokopter.ports import MicrocontrollerPorts
from vehicle.boards.mikrokopter.sample_stamps import FineStamps
from vehicle_link.identity import THE_ONE, Identity
from vehicle_link.link_counts import LinkCounts
from vehicle_link.serial.attitude_command import AttitudeCommand
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
from vehicle_link.serial.ids import MIRROR, PRESSURE_OFFSET, FlightControlMode, Id
from vehicle_link.serial.port import Port

REPEAT_COMMAND_S = 0.006
KEEP_COMMAND_S = 0.04
"""Oldest command that is sent: an old one must not keep the microcontroller from landing."""

TRAITS = Traits("mikrokopter", (CommandKind.MOTORS, CommandKind.ANGLES), line_ns=FRAME_NS)

_MOTOR_STATES = tuple(MotorState)
_MODES = frozenset(FlightControlMode)
_RESTING = (MotorState.INIT, MotorState.OFF)
_DIRECT = FlightControlMode.DIRECT
_STOPPED = (0, 0, 0, 0)


class Microcontroller:
    """A microcontroller behind one or both of its serial ports.

    Args:
        ports: one or two; requests go to the first, references to all in turn.
        epoch_ns: time of the first sample; None uses the host's epoch time (see
            vehicle.boards.mikrokopter.clock).
        rate: IMU samples a second to ask for; motors do not start before it is confirmed.
        identity: what it must be before motors may start.

    Attributes:
        failures: lines about sets and requests given up, lost ports and clocks that were set, for
        the caller to report and clear.
        flight_control_mode: what the microcontroller has confirmed last.
        refused: number of D frames with impossible values or times.
        late: number of samples dropped because they were older than the newest one.
        newest_ms: the microcontroller's time in the last D frame of each port; -1 before.
        link: counts of its lines; round trips are those of the motor controllers' poll, at rest.
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
        self.newest_ms, self.link = [-1] * len(ports), LinkCounts()
        self._ports = MicrocontrollerPorts(ports, self.failures)
        self._clock = MicrocontrollerClock(epoch_ns)
        period_us = sample_period_us(rate)
        self._stamps = FineStamps(1000 * period_us)
        self._command: Sequence[int] = _STOPPED
        self._mode = FlightControlMode.DIRECT  # of the command
        self._is_new = False  # whether the command is new since the last service
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
        self._bus = MotorBus(self.link)
        for request in self._handshake.open:
            self._ports.write(request.build(_STOPPED))

    @property
    def connected(self) -> bool:
        """Return whether it is the right microcontroller, mirrors the IMU and is in direct mode."""
        return not self._handshake.open

    @property
    def obstacle(self) -> str:
        """Return the known reason why motors would not start; empty when they would."""
        if not self._handshake.open:
            return self._bus.why
        waiting = self._handshake.open[0]
        return (
            f"the microcontroller is not recognised: could not yet {waiting.name}, "
            f"{waiting.outcome}"
        )

    @property
    def damaged(self) -> int:
        """Return the number of runs of bytes, on all ports, that are not frames."""
        return self._ports.damaged

    @property
    def lost_ports(self) -> int:
        """Return the number of lost ports."""
        return self._ports.lost

    def filenos(self) -> tuple[int, ...]:
        """Return the file descriptors for poll(). Raises LinkError for ports in memory."""
        return self._ports.filenos()

    def receive(self) -> list[RawSample]:
        """Return the samples that arrived, oldest first, each newer than all before.

        Raises LinkError when the last port is lost.
        """
        samples: list[RawSample] = []
        settled = self._clock.settled
        for index, frame in self._ports.read():
            values = decode_data(frame)
            if values is None:
                self._take_reply(frame)
                continue
            self.newest_ms[index] = values[0] & 0xFFFF
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
        samples = self._stamps.in_order(samples)
        self.late = self._stamps.late
        return samples

    def command(self, command: Command) -> None:
        """Send motor references or an attitude, changing the flight control mode if needed.

        Raises OutOfBoundsError or, when the last port is lost, LinkError.
        """
        if isinstance(command, tuple):
            self._command, self._mode = command, _DIRECT
        elif isinstance(command, AttitudeCommand):
            self._command, self._mode = command.encode(), FlightControlMode.NEAR_HOVERING
        else:
            raise OutOfBoundsError(TRAITS.missing(CommandKind.RATES))
        self._is_new = True
        self._send_command()

    def set_motor_state(self, state: MotorState) -> None:
        """Request this motor state from the next `service` on, until it is echoed.

        Motors are switched on only once `connected`; any other state is requested at once.
        """
        if state is not MotorState.ON:
            self._command, self._is_new, self._made_s = _STOPPED, False, -math.inf
        self._motors.put(set_value(Id.MOTOR_STATE, state, persistent=state is not MotorState.ON))

    def set_command_timeout(self, milliseconds: int) -> None:
        """Request this timeout from the next `service` on, until it is echoed."""
        self._motors.put(set_value(Id.EMERGENCY_TIMEOUT, milliseconds))

    def service(self, now_s: float) -> None:
        """Send all messages that are due, also retries; `now_s` is from any monotonic clock."""
        for frame in self._handshake.service(now_s, self._command):
            self._ports.write(frame)
        for request in self._motors.open:
            starting = request.key == Id.MOTOR_STATE and request.expected == MotorState.ON
            request.hold = "it is not recognised yet" if starting and not self.connected else ""
        for frame in self._motors.service(now_s, self._command):
            self._ports.write(frame)
        # The motor state as reported by samples: unknown without any.
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
        self.link.commands += 1
        self._ports.write(frame, in_turn=True)

    def _sample(self, values: tuple[int, ...], settled: bool) -> RawSample | None:
        """Return a sample of the values of MIRROR, with elapsed time until the clock is settled."""
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
        """Correct the clock; samples are dropped until it passes the newest stamp again."""
        ahead = self._clock.correct(newest_ns - self._clock.stamp_ns(0))
        if ahead:
            self.failures.append(f"the vehicle's clock was {ahead * 1e3:.0f} ms ahead; set back")

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
        line = self._bus.receive(key, answer)
        if line is not None:
            self.failures.append(line)


def _connect(
    ports: Sequence[Port],
    options: Parameters | None,
    rate: int,
    now_ns: Callable[[], int] | None,
    unfit: str = "",
) -> Microcontroller:
    return Microcontroller(ports, None if now_ns is None else now_ns(), rate=rate)


KIND = Kind(TRAITS, _connect)
