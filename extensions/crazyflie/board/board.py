"""A Crazyflie behind its radio, or a simulated one behind UDP.

At the start, and after each silence, a dialogue makes sure of its protocol version, sets its
parameters and starts its log blocks. Then the IMU comes at 100 Hz, and set-points go up. Its
watchdog is its own: without set-points for 0.5 s it levels out, after 2 s it stops its motors and
stays locked. Given up, it descends level with less thrust than its weight as long as the radio
carries set-points: it has no landing of its own that needs none. When this process is silent, who
has the radio lands it (see `guard`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from extensions.crazyflie.board.arming import why_not_armed
from extensions.crazyflie.board.dialogue import Found, introduce, set_parameters
from extensions.crazyflie.board.firmware_parameters import FirmwareParameters
from extensions.crazyflie.board.messages import (
    DATA,
    EMERGENCY_STOPPED,
    ESTIMATE,
    IMU,
    PASCAL,
    STATUS,
    STOPPED,
    Info,
    arm,
    imu_counts,
    pose,
    setpoint,
)
from extensions.crazyflie.board.options import CrazyflieOptions
from extensions.crazyflie.board.requests import Requests
from extensions.crazyflie.board.stamps import RadioStamps
from extensions.crazyflie.board.traits import TRAITS
from extensions.crazyflie.crtp.packets import CrtpPort, FrameReader, Packet, decode, frame
from extensions.crazyflie.crtp.radio import RadioPort
from quadrotor.errors import LinkError, OutOfBoundsError
from quadrotor.motor_state import MotorState
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle.boards.board import BodyRates, Command, CommandKind, RawSample
from vehicle_link import clock
from vehicle_link.link_counts import LinkCounts
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.port import Port

AGAIN_S = 0.1
"""Seconds between two looks for changed options, and between two packets that arm or disarm."""
SETPOINT_S = 0.05
"""Time, in s, between two set-points that no command made."""
OBEYED_S = 0.5
"""Seconds after which one that still flies is stopped for good."""
SILENT_S = 1.0
"""Seconds without a sample after which the dialogue begins again: it may have been switched off."""
TWO = "two Crazyflies answer at this address: switch one off, or give each one its own in cfclient"
ALONE = Info(0), Info.AUTO_ARMED, Info.AUTO_ARMED | Info.ARMED
"""States of arming in which there is nothing to disarm: some arm themselves."""
FALLS = "without its radio the Crazyflie falls: its firmware then stops the motors after 2 s"
UNGUARDED = ", and so it does when this process ends: fly it through `quadlab crazyradio`"
_IDLE = BodyRates((0.0, 0.0, 0.0), 0.0)


class CrazyflieBoard:
    """One Crazyflie, as the flight loop uses it (see vehicle.boards.board.Board).

    Args:
        ports: one link.
        now_ns: the vehicle's clock, which gives the samples their stamps.
        unfit: why it must not be armed; "" when it can be flown.
        is_passive: set no parameter, and send no set-points.

    Attributes:
        found: what the last dialogue found.
        unfit: why it cannot be flown, as the dialogue found.
        packets: number of packets that came.
        confirmed: parameters of the vehicle that must follow the Crazyflie's; the caller clears it.
    """

    def __init__(
        self,
        ports: Sequence[Port],
        options: CrazyflieOptions,
        *,
        now_ns: Callable[[], int] = clock.time_ns,
        unfit: str = "",
        is_passive: bool = False,
    ) -> None:
        if len(ports) != 1:
            raise LinkError(f"{len(ports)} links given; a Crazyflie has one")
        self.failures: list[str] = []
        self.newest_ms = [-1]
        self._counts = LinkCounts()
        self.refused = self.late = self.lost_ports = 0
        self.found, self._finding, self._is_ready = Found(), Found(), False
        self.unfit, self.packets = "", 0
        self._is_passive, self._is_warned = is_passive, False
        options.check_together()
        self._port, self._options = ports[0], options
        self.confirmed: dict[str, ParameterValue] = {}
        self._parameters = FirmwareParameters(options)
        self._is_changing = False  # the dialogue sets parameters of a board that is ready
        self._now_ns = now_ns
        self._frames = FrameReader()
        self._stamps = RadioStamps()
        self._samples: list[RawSample] = []
        self._newest_ns = -1
        self._requests = Requests(self._write, now_ns, self._note_round_trip)
        self._misfit = unfit
        self._pressure = self._voltage = 0.0
        self._info, self._console = Info(0), b""
        self._own_position: tuple[float, ...] | None = None
        self._distance = 0.0
        self._is_double = False
        self._wanted, self._wanted_s = MotorState.OFF, math.inf
        self._command: BodyRates | AttitudeCommand = _IDLE
        self._now_s = self._heard_s = -math.inf
        self._setpoint_due_s = self._arm_due_s = self._pose_due_s = self._look_due_s = -math.inf

    # ------------------------------------------------------------------ reports
    @property
    def damaged(self) -> int:
        return self._frames.damaged

    @property
    def state(self) -> MotorState:
        """Return the state of the motors; one that arms itself is on when that is wanted."""
        wants = self._wanted in (MotorState.ON, MotorState.EMERGENCY)
        if not (Info.FLYING in self._info or (Info.ARMED in self._info and wants)):
            return MotorState.OFF
        return MotorState.EMERGENCY if self._wanted is MotorState.EMERGENCY else MotorState.ON

    @property
    def obstacle(self) -> str:
        if self.state is MotorState.ON:
            return ""  # whatever it is, it does not stop motors in the air
        if self.unfit or self._misfit:
            return self.unfit or self._misfit
        if self._is_double:
            return TWO
        if not self._is_ready:
            return "the Crazyflie is not recognised: it has not answered all requests yet"
        return why_not_armed(self._info, self._distance)

    @property
    def link(self) -> LinkCounts:
        """Return the counts of the radio's exchanges, or without a radio those of the dialogue."""
        if isinstance(self._port, RadioPort):
            return replace(self._port.counts, commands=self._counts.commands)
        return self._counts

    @property
    def is_flying(self) -> bool:
        return Info.FLYING in self._info

    def filenos(self) -> Sequence[int]:
        return (self._port.fileno(),)

    def receive(self) -> list[RawSample]:
        for data in self._frames.feed(self._port.read()):
            self.packets += 1
            try:
                self._take(decode(data))
            except LinkError as error:
                self._requests.cancel()  # tried again after a silence
                if self._is_changing:
                    self._end_change()
                    self.failures.append(f"not set: {error}")
                    continue
                self._heard_s = self._now_s
                self.refused += 1
                if not self.unfit:
                    self.unfit = str(error)
                    self.failures.append(self.unfit)
        samples, self._samples = self._samples, []
        return samples

    def _take(self, packet: Packet) -> None:
        if (packet.port, packet.channel) == (CrtpPort.LOG, DATA):
            self._take_block(packet.data)
        elif self._requests.is_answered_by(packet):
            self._advance(packet.data)
        elif packet.port == CrtpPort.CONSOLE:
            *lines, self._console = (self._console + packet.data).split(b"\n")
            self.failures += [f"Crazyflie: {line.decode('utf-8', 'replace')}" for line in lines]

    def _advance(self, answer: bytes) -> None:
        """Go on with the dialogue."""
        self._is_ready = self._is_changing
        if not self._requests.advance(answer, self._now_s):
            return
        if self._is_changing:
            self._end_change()
            return
        self.confirmed |= self._parameters.confirm(self._finding.confirmed)
        self.found, self.unfit, self._is_ready = self._finding, "", True
        self._info, self._own_position, self._distance = Info(0), None, 0.0
        self._heard_s = self._now_s
        if not self._is_passive and not self._is_warned:
            self._is_warned = True
            self.failures.append(FALLS + isinstance(self._port, RadioPort) * UNGUARDED)

    def _note_round_trip(self, duration_ns: int) -> None:
        self._stamps.note_round_trip(duration_ns)
        self._counts.answered += 1
        self._counts.round_trips_ns += duration_ns

    def _take_block(self, data: bytes) -> None:
        form = self.found.forms.get(data[0]) if data else None
        if form is None or len(data) != 4 + form.size:
            return  # of another start, or not ours
        values = form.unpack_from(data, 4)
        if data[0] == IMU.number:
            self._sample(int.from_bytes(data[1:4], "little"), values)
        elif data[0] == STATUS.number:
            self._pressure, self._voltage = PASCAL * values[0], values[1]
            self._info = Info(int(values[2]) & 0xFF)
        elif data[0] == ESTIMATE.number:
            self._own_position = values

    def _sample(self, ms: int, values: tuple[float, ...]) -> None:
        self._heard_s = self._now_s
        if self._is_ready and not self._is_changing:
            self._requests.cancel()  # it was out of reach, and still is what it was
        if not all(map(math.isfinite, values)):
            self.refused += 1
            return
        stamp_ns = self._stamps.stamp_ns(ms, self._now_ns())
        is_double = self._stamps.is_double(self._now_s)
        if is_double and not self._is_double:
            self.failures.append(TWO)
        self._is_double = is_double
        if stamp_ns <= self._newest_ns:
            self.late += 1
            return
        if self._pressure == 0.0:
            return  # battery and pressure come with the first status
        self._newest_ns = stamp_ns
        self.newest_ms[0] = ms % 60_000
        accelerometer, gyroscope = imu_counts(values)
        sample = accelerometer, gyroscope, self._voltage, self._pressure, self.state
        self._samples.append(RawSample(stamp_ns, *sample))

    # ------------------------------------------------------------------ commands
    def command(self, command: Command) -> None:
        """Send a command. Raises OutOfBoundsError, LinkError."""
        if isinstance(command, tuple):
            raise OutOfBoundsError(TRAITS.missing(CommandKind.MOTORS))
        self._command = command
        self._send_setpoint()

    def locate(self, state: Record, now_s: float) -> None:
        """Send our STATE (1,) to its estimator when that is due."""
        rate = self._options.pose_rate
        if not self._is_ready or rate == 0.0:
            return
        if now_s >= self._pose_due_s:
            self._pose_due_s = max(self._pose_due_s, now_s - 1.0 / rate) + 1.0 / rate
            self._write(pose(state))
        if self._own_position is not None:
            self._distance = math.dist(self._own_position, state["position_w"][0])

    def set_motor_state(self, state: MotorState) -> None:
        """Arm, disarm at once, or descend level."""
        self._wanted, self._command = state, _IDLE
        self._wanted_s, self._arm_due_s = self._now_s, -math.inf
        self._send_setpoint()

    def set_command_timeout(self, milliseconds: int) -> None:
        """Do nothing: the times are fixed in the firmware."""

    def service(self, now_s: float) -> None:
        """Send the messages that are due: requests, arming, and set-points that no command makes.

        A command is not repeated: without new ones, its own watchdog is what helps.
        """
        self._now_s = now_s
        is_free = not self._requests.is_open or self._is_changing
        if is_free and now_s - self._heard_s > SILENT_S:
            self._begin()
        elif not self._requests.is_open and self._is_ready and now_s >= self._look_due_s:
            self._look_due_s = now_s + AGAIN_S
            if changes := self._parameters.changes():
                self._change(changes)
        self._requests.repeat(now_s)
        given_up_s = now_s - self._wanted_s if self._wanted is MotorState.EMERGENCY else 0.0
        if given_up_s > self._options.landing_time:
            self.set_motor_state(MotorState.OFF)
        if self._is_passive or not self._is_ready:
            return
        if now_s >= self._arm_due_s:
            self._arm_due_s = now_s + AGAIN_S
            self._switch()
        if now_s >= self._setpoint_due_s and self._wanted is not MotorState.ON:
            self._send_setpoint()

    def _begin(self) -> None:
        """Begin the dialogue, which a sample ends that comes before the first answer."""
        self._finding, self._is_changing = Found(), False
        wanted, write = self._parameters.all(), not self._is_passive
        dialogue = introduce(self._finding, self._options.named, wanted, write=write)
        self._requests.begin(dialogue, self._now_s)

    def _change(self, values: Mapping[str, float]) -> None:
        """Set these parameters; set-points go on meanwhile."""
        self._finding, self._is_changing = Found(), True
        self._requests.begin(set_parameters(self._finding, values), self._now_s)

    def _end_change(self) -> None:
        """Report what was set of a change, which may have failed at one of its parameters."""
        self._is_changing = False
        self.failures += [
            f"the Crazyflie has set {name} to {after:g}, it was {before:g}"
            for name, (before, after) in self._finding.changed.items()
            if name in self._finding.confirmed and self._parameters.is_of_text(name)
        ]
        self.confirmed |= self._parameters.confirm(self._finding.confirmed)

    def _switch(self) -> None:
        """Arm or disarm where the board is not in the state that is wanted."""
        if self._wanted is MotorState.ON and Info.ARMED not in self._info and not self.obstacle:
            self._write(arm(True))
        elif self._wanted is not MotorState.OFF:
            return
        elif Info.FLYING in self._info and self._now_s - self._wanted_s > OBEYED_S:
            self._write(EMERGENCY_STOPPED)
        elif self._info & (Info.ARMED | Info.AUTO_ARMED | Info.FLYING) not in ALONE:
            self._write(arm(False))

    def _send_setpoint(self) -> None:
        if not self._is_ready:
            return
        self._setpoint_due_s = self._now_s + SETPOINT_S
        self._counts.commands += 1
        command = self._command
        if self._wanted is MotorState.EMERGENCY:
            thrust = self._options.landing_thrust
            command = AttitudeCommand(0.0, 0.0, 0.0, 0.0, thrust)
        is_off = self._wanted is MotorState.OFF
        self._write(STOPPED if is_off else setpoint(command, self._options))

    def _write(self, packet: Packet) -> None:
        self._port.write(frame(packet.encode()))
