"""Commands for flight in the microcontroller's near-hovering mode.

The microcontroller holds angles and yaw rate by its own estimate. The climb rate is controlled
here, by the barometer, as is the descent when no other estimate on board can be trusted.
"""

from __future__ import annotations

from collections.abc import Callable

from control.behaviors.near_hovering import Level
from vehicle.flight.control_law import ControlLaw
from vehicle.flight_parameters import NearHoveringParameters
from vehicle.safety.barometric_height import BarometricHeight
from vehicle.safety.blind_descent import BlindDescent
from vehicle_link.serial.attitude_command import THRUST_SHARE_MAX, THRUST_SHARE_MIN, AttitudeCommand

AVERAGE = 0.5
"""Time, in s, of the thrust average that is the hover thrust when the mode begins."""


class NearHovering:
    """Control of the microcontroller in near-hovering mode: one command per tick.

    Args:
        parameters: read at each tick.
        say: takes a warning for the log.

    Attributes:
        altitude: height and climb rate by the barometer, updated in every mode.
        descent: watches descents, in every mode.
    """

    def __init__(self, parameters: NearHoveringParameters, say: Callable[[str], object]) -> None:
        self.parameters = parameters
        self.altitude = BarometricHeight()
        self.descent = BlindDescent(self.altitude, say)
        self._share = 0.0  # share of the stick thrust, averaged
        self._lift: float | None = None  # integral of the climb rate control, a share
        self._hover = 1.0  # share of the stick thrust in hover when the mode began

    def observe(self, thrust: float, dt: float) -> None:
        """Observe the thrust (N) of a tick that was flown by another mode."""
        share = thrust / self.parameters.stick_thrust
        self._share += min(1.0, dt / AVERAGE) * (share - self._share)
        self._lift = None

    def command(
        self, level: Level, law: ControlLaw, dt: float, unloading: float = 0.0
    ) -> AttitudeCommand:
        """Return the command for the board.

        Args:
            law: provides the mass and the motors' law.
            unloading: share of the hover thrust to take away, to test for the ground.
        """
        p = self.parameters
        if self._lift is None:
            self._lift = self._hover = min(THRUST_SHARE_MAX, max(THRUST_SHARE_MIN, self._share))
        if level.climb is None:
            share = self._hover * level.thrust_share
        else:
            wanted = level.climb
            if wanted < -p.flare_speed and self.altitude.height < p.flare_height:
                wanted = -p.flare_speed
            error = wanted - self.descent.extra - self.altitude.climb
            per_acceleration = law.mass / p.stick_thrust
            if not unloading:
                lift = self._lift + p.lift_gain * per_acceleration * error * dt
                self._lift = min(THRUST_SHARE_MAX, max(THRUST_SHARE_MIN, lift))
            share = self._lift + p.climb_gain * per_acceleration * error
        share = min(THRUST_SHARE_MAX, max(THRUST_SHARE_MIN, share - unloading * self._hover))
        thrust = share * p.stick_thrust
        throttle = law.throttle(thrust)
        return AttitudeCommand(level.roll, level.pitch, level.yaw_rate, share, thrust, throttle)
