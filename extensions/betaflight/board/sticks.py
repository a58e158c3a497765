"""Commands as stick channels: roll, pitch, throttle, yaw, then arm, angle mode and failsafe.

Sticks are linear in rate (`rates_type = ACTUAL`, no expo, no dead band). Roll and pitch have the
signs of this project's body axes; a stick to the right yaws clockwise, against z.
"""

from __future__ import annotations

import math

from extensions.betaflight.board.options import BetaflightOptions
from quadrotor.errors import OutOfBoundsError
from vehicle.boards.board import BodyRates, CommandKind, Traits
from vehicle_link.serial.attitude_command import AttitudeCommand

TRAITS = Traits(
    "betaflight",
    (CommandKind.RATES, CommandKind.ANGLES),
    {
        "imu.accelerometer_scale": 1.0 / 256.0,
        "imu.accelerometer_zero": 0.0,
        "imu.gyroscope_scale": 2000.0 / 32768.0,
        "imu.gyroscope_zero": 0.0,
    },
    reports_pressure=False,
)
MIDDLE, HALF, LOW, HIGH = 1500.0, 500.0, 1000.0, 2000.0
"""Pulse widths, in µs."""
RC_CHANNELS = 8
"""Number of channels sent: four sticks, arm, angle mode, failsafe, one spare."""
Four = tuple[float, float, float, float]


class Sticks:
    """Converter from commands to channels, in the order A E T R of the firmware's default map.

    A pulse is a whole number of µs, each 0.8 deg/s: the rounding error is carried over to the next
    command, as vehicle.boards.reference_rounding does for motors.
    """

    def __init__(self, options: BetaflightOptions) -> None:
        self._options = options
        self._carry = [0.0] * 4

    def channels(
        self, command: BodyRates | AttitudeCommand, *, arm: bool, failsafe: bool = False
    ) -> list[int]:
        """Return the channels, whole µs. Raises OutOfBoundsError unless all numbers are finite."""
        is_angle = isinstance(command, AttitudeCommand)
        wanted = self._wanted(command)
        if not all(map(math.isfinite, wanted)):
            raise OutOfBoundsError(f"{command} cannot be sent; every number must be finite")
        pulses = [self._whole(index, pulse) for index, pulse in enumerate(wanted)]
        switches = (HIGH if on else LOW for on in (arm, is_angle, failsafe))
        return [*pulses, *map(int, switches), int(LOW)]

    def _wanted(self, command: BodyRates | AttitudeCommand) -> Four:
        p = self._options
        if isinstance(command, BodyRates):
            full = math.radians(p.rate_max)
            roll, pitch, yaw = (rate / full for rate in command.rates_b)
            throttle = command.throttle
        else:
            full = math.radians(p.angle_max)
            roll, pitch = command.roll / full, command.pitch / full
            yaw, throttle = command.yaw_rate / math.radians(p.rate_max), command.throttle
        return (
            MIDDLE + HALF * roll,
            MIDDLE + HALF * pitch,
            self._throttle_pulse(throttle),
            MIDDLE - HALF * yaw,
        )

    def _throttle_pulse(self, throttle: float) -> float:
        """Return the pulse that drives the motors at this share of their range, on average."""
        p = self._options
        if throttle <= 0.0:
            return LOW  # under `min_check`; the board does not arm otherwise
        idle = 0.01 * p.idle
        share = max(0.0, (throttle - idle) / (1.0 - idle))
        return p.min_check + share * (HIGH - p.min_check)

    def _whole(self, index: int, pulse: float) -> int:
        exact = pulse + self._carry[index]
        whole = round(exact)
        within = min(max(whole, int(LOW)), int(HIGH))
        self._carry[index] = exact - whole if within == whole else 0.0
        return within
