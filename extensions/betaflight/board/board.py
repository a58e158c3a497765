"""A flight controller with Betaflight behind one or two UARTs.

The first port speaks MSP: the IMU is polled at the sample rate, status and battery in turn, and the
firmware's version once at the start. Stick commands are sent by CRSF over the second port; without
one they are sent by MSP, which the firmware accepts with `feature RX_MSP`.

MSP has no time stamps: a sample is stamped with the arrival of its answer less half the round trip.
To make the board land by itself, no more sticks are sent, just as when the computer fails. Nor are
any while it flies and the ticks have ended.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from extensions.betaflight.board.arming import JUST_SWITCHED_ON, why_not_armed
from extensions.betaflight.board.check import check_board
from extensions.betaflight.board.messages import (
    ARM_BOX,
    FAILSAFE_BOX,
    Function,
    Status,
    check_firmware,
    decode_imu,
    decode_status,
    decode_voltage,
)
from extensions.betaflight.board.options import BetaflightOptions
from extensions.betaflight.board.sticks import TRAITS, Sticks
from extensions.betaflight.msp.crsf import encode_channels
from extensions.betaflight.msp.frames import ERROR, Message, MessageDecoder, encode
from quadrotor.errors import LinkError, OutOfBoundsError
from quadrotor.motor_state import MotorState
from quadrotor.parameters import Parameters
from vehicle.boards.board import BodyRates, Command, CommandKind, RawSample
from vehicle.boards.kind import Kind
from vehicle_link import clock
from vehicle_link.link_counts import LinkCounts
from vehicle_link.serial.attitude_command import AttitudeCommand
from vehicle_link.serial.port import BAUD_RATE, Port

ASKED_AGAIN_S = 0.02
"""Seconds after which an unanswered IMU request counts as lost and is sent again."""
STICKS_S = 0.02
"""Longest time, in s, between two stick commands; after more, the board's failsafe begins."""
SLOW_S = 0.1
"""Period, in s, of the status requests, and of the battery requests."""
CRSF_BAUD_RATE = 420_000
PRESSURE = 101_325.0
"""Pa, constant: MSP reports no pressure, only a height."""
MILLISECONDS = 60_000
RESTARTED = (
    "the board was switched on again, perhaps with other settings: start quadlab vehicle again, "
    "which checks them"
)
_START = (Function.VARIANT, Function.VERSION, Function.BOX_IDS)
_IDLE = BodyRates((0.0, 0.0, 0.0), 0.0)


class BetaflightBoard:
    """Board with Betaflight, as the flight loop uses it (see vehicle.boards.board.Board).

    Args:
        ports: the MSP port, and optionally the CRSF port.
        rate: IMU samples requested per second.
        now_ns: the vehicle's clock, which gives the samples their stamps.
        unfit: why it must not be armed; "" when its settings match the options.
    """

    def __init__(
        self,
        ports: Sequence[Port],
        options: BetaflightOptions,
        *,
        rate: int,
        now_ns: Callable[[], int] = clock.time_ns,
        unfit: str = "",
    ) -> None:
        if not 1 <= len(ports) <= 2:
            raise LinkError(f"{len(ports)} ports given; a board with Betaflight has one or two")
        self.failures: list[str] = []
        self.newest_ms = [-1]
        self.link = LinkCounts()
        self.refused = self.late = self.lost_ports = 0
        self._msp, self._crsf = ports[0], ports[1] if len(ports) > 1 else None
        self._sticks, self._newer, self._now_ns = Sticks(options), options.newer, now_ns
        self._decoder = MessageDecoder()
        self._period_s = 1.0 / rate
        self._samples: list[RawSample] = []
        self._newest_ns = -1
        self._asked: dict[int, float] = {}  # when each function was asked for last
        self._imu_asked_ns = 0
        self._told: dict[int, bytes] = {}
        self._unfit, self._misfit, self._was_ready = "", unfit, False
        self._blocks, self._block_count = -1, 0
        self._voltage = 0.0
        self._state = MotorState.INIT
        self._wanted = MotorState.OFF
        self._command: BodyRates | AttitudeCommand = _IDLE
        self._sticks_due_s = self._imu_due_s = -math.inf

    # ------------------------------------------------------------------ reports
    @property
    def damaged(self) -> int:
        return self._decoder.damaged

    @property
    def obstacle(self) -> str:
        if self._state is MotorState.ON:
            return ""  # whatever it is, it does not stop motors in the air
        if self._unfit or self._misfit:
            return self._unfit or self._misfit
        if any(function not in self._told for function in _START) or self._blocks < 0:
            return "the board is not recognised: it has not answered by MSP yet"
        return why_not_armed(self._blocks, self._block_count)

    def filenos(self) -> Sequence[int]:
        return (self._msp.fileno(),)

    def receive(self) -> list[RawSample]:
        for message in self._decoder.feed(self._msp.read()):
            try:
                self._take(message)
            except LinkError as error:
                self.refused += 1
                if not self._unfit:
                    self._unfit = str(error)
                    self.failures.append(self._unfit)
        samples, self._samples = self._samples, []
        return samples

    def _take(self, message: Message) -> None:
        function, payload = message.function, message.payload
        if message.direction == ERROR:
            self._asked.pop(function, None)
        elif function == Function.RAW_IMU:
            self._asked.pop(function, None)
            self._sample(*decode_imu(payload))
        elif function == Function.STATUS:
            self._take_status(payload)
        elif function == Function.ANALOG:
            self._voltage = decode_voltage(payload)
        elif function in _START:
            self._told[function] = payload
            if Function.VARIANT in self._told and Function.VERSION in self._told:
                self._unfit = check_firmware(
                    self._told[Function.VARIANT], self._told[Function.VERSION], newer=self._newer
                )

    def _take_status(self, payload: bytes) -> None:
        status, ids = decode_status(payload), self._told.get(Function.BOX_IDS)
        self._blocks, self._block_count = status.arming_blocks, status.block_count
        self._note_restart(status)
        if ids is None:
            return
        on = status.modes(ids)
        if ARM_BOX not in on:
            self._state = MotorState.OFF
        else:
            self._state = MotorState.EMERGENCY if FAILSAFE_BOX in on else MotorState.ON

    def _note_restart(self, status: Status) -> None:
        """Trust its settings no longer when it was switched on again: they may be others now."""
        is_new = bool(status.arming_blocks & JUST_SWITCHED_ON)
        if is_new and self._was_ready and not self._misfit:
            self._misfit = RESTARTED
            self.failures.append(RESTARTED)
        self._was_ready = not is_new

    def _sample(self, accelerometer: tuple[int, int, int], gyroscope: tuple[int, int, int]) -> None:
        now_ns = self._now_ns()
        self.link.answered += 1
        self.link.round_trips_ns += now_ns - self._imu_asked_ns
        stamp_ns = now_ns - (now_ns - self._imu_asked_ns) // 2
        if stamp_ns <= self._newest_ns:
            self.late += 1
            return
        self._newest_ns = stamp_ns
        self.newest_ms[0] = stamp_ns // 1_000_000 % MILLISECONDS
        self._samples.append(
            RawSample(stamp_ns, accelerometer, gyroscope, self._voltage, PRESSURE, self._state)
        )

    # ------------------------------------------------------------------ commands
    def command(self, command: Command) -> None:
        """Send a command with the next `service`. Raises OutOfBoundsError, LinkError."""
        if isinstance(command, tuple):
            raise OutOfBoundsError(TRAITS.missing(CommandKind.MOTORS))
        self._command = command
        self._send_sticks()

    def set_motor_state(self, state: MotorState) -> None:
        """Arm or disarm by the arm switch, land without sticks; armed only without an obstacle."""
        self._wanted = state
        self._command = _IDLE

    def set_command_timeout(self, milliseconds: int) -> None:
        """Do nothing: the time is the board's own setting, compared by `--check`."""

    def service(self, now_s: float) -> None:
        """Send the requests that are due, and the sticks at rest that no command makes.

        A command is not repeated: when the ticks end, for want of samples for instance, the board's
        own failsafe lands it.
        """
        for function in _START:
            if function not in self._told:
                self._ask(function, now_s, SLOW_S)
        self._ask(Function.STATUS, now_s, SLOW_S)
        self._ask(Function.ANALOG, now_s, SLOW_S)
        asked_s = self._asked.get(Function.RAW_IMU)
        if now_s >= self._imu_due_s and (asked_s is None or now_s - asked_s > ASKED_AGAIN_S):
            self._imu_due_s = max(self._imu_due_s + self._period_s, now_s)
            self._imu_asked_ns = self._now_ns()
            self._ask(Function.RAW_IMU, now_s, 0.0)
        flies = self._state is MotorState.ON and self._wanted is MotorState.ON
        if now_s >= self._sticks_due_s and not flies:
            self._sticks_due_s = now_s + STICKS_S
            self._send_sticks()

    def _ask(self, function: Function, now_s: float, period_s: float) -> None:
        if now_s - self._asked.get(function, -math.inf) >= period_s:
            self._asked[function] = now_s
            self._msp.write(encode(function))

    def _send_sticks(self) -> None:
        if self._wanted is MotorState.EMERGENCY:
            return  # its failsafe switch would land it tilted while sticks arrive (4.6)
        arm = self._wanted is MotorState.ON and not self.obstacle
        is_armed = self._state in (MotorState.ON, MotorState.EMERGENCY)
        command = self._command if is_armed else _IDLE  # it does not arm at any other throttle
        channels = self._sticks.channels(command, arm=arm)
        self.link.commands += 1
        if self._crsf is not None:
            self._crsf.write(encode_channels(channels))
        else:
            payload = b"".join(channel.to_bytes(2, "little") for channel in channels)
            self._msp.write(encode(Function.SET_RC, payload))


def _connect(
    ports: Sequence[Port],
    options: Parameters | None,
    rate: int,
    now_ns: Callable[[], int] | None,
    unfit: str = "",
) -> BetaflightBoard:
    assert isinstance(options, BetaflightOptions)
    return BetaflightBoard(ports, options, rate=rate, now_ns=now_ns or clock.time_ns, unfit=unfit)


def _simulate(options: Parameters | None, number: int) -> object:
    from extensions.betaflight.simulated.firmware import BetaflightFirmware

    assert isinstance(options, BetaflightOptions)
    return BetaflightFirmware(options)


def _build() -> object:
    from extensions.betaflight.simulated.process import lockstep_library

    return lockstep_library()


KIND = Kind(
    TRAITS,
    _connect,
    BetaflightOptions,
    rate=250,
    bauds=(BAUD_RATE, CRSF_BAUD_RATE),
    poll_ms=1,
    check=check_board,
    simulate=_simulate,
    build=_build,
)
