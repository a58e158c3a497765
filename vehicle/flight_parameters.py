"""Parameters of the mass in use, and of flight in the microcontroller's near-hovering mode."""

from __future__ import annotations

from estimation.identification.mass_estimator import MassParameters
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, parameter

MODEL, ESTIMATE = "model", "estimate"


class FlownMassParameters(MassParameters):
    """The mass estimator's gains, and whether the control law uses the estimate."""

    used_by: str = parameter(MODEL, choices=(MODEL, ESTIMATE))
    """mass used by the control law, the feed-forward and the touch-down detection: model.mass or
    the estimate; cannot be changed while armed"""
    initial: float = parameter(0.0, unit="kg", ge=0.0, le=2.4, step=0.001)
    """initial value of the mass estimate, used from the next arming on; 0 means model.mass; if too
    large, the vehicle jumps off the ground"""

    def check_together(self) -> None:
        """Check that the values fit together. Raises OutOfBoundsError."""
        if self.initial and not self.mass_min <= self.initial <= self.mass_max:
            raise OutOfBoundsError(
                f"mass.initial = {self.initial:g} kg is not between mass.mass_min = "
                f"{self.mass_min:g} and mass.mass_max = {self.mass_max:g} kg; 0 is model.mass"
            )


class NearHoveringParameters(Parameters):
    """The parameters of the climb-rate control in near-hovering mode."""

    stick_thrust: float = parameter(12.83, unit="N", ge=0.1, le=40.0, step=0.01)
    """thrust of the microcontroller's stick in its hovering position, 110"""
    climb_gain: float = parameter(3.0, unit="1/s", ge=0.5, le=8.0, step=0.1)
    """proportional gain of the climb-rate control"""
    lift_gain: float = parameter(2.0, unit="1/s²", ge=0.0, le=8.0, step=0.1)
    """integral gain of the climb-rate control"""
    flare_height: float = parameter(0.7, unit="m", ge=0.0, le=3.0, step=0.1)
    """height above the take-off point below which a descent slows down"""
    flare_speed: float = parameter(0.35, unit="m/s", ge=0.1, le=0.8, step=0.05)
    """descent rate below flare_height"""
