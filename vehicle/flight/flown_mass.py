"""The mass the law flies on: the model's, or the estimate of Sec. 5.4.

Which of the two is chosen on the ground: in flight the one may be far from the other, and the
thrust would jump by as much.
"""

from __future__ import annotations

from collections.abc import Mapping

from estimation.identification.mass_estimator import MassEstimator, MassParameters
from quadrotor.errors import OutOfBoundsError, RefusedError
from quadrotor.parameters import ParameterValue, parameter

MODEL, ESTIMATE = "model", "estimate"
USED_BY = "mass.used_by"


class FlownMassParameters(MassParameters):
    """The estimator's gains, and whether the law flies on it."""

    used_by: str = parameter(
        MODEL,
        choices=(MODEL, ESTIMATE),
        description="mass of the law, its feed-forward and touch-down: model.mass or the "
        "estimate; not changed while armed",
    )
    initial: float = parameter(
        0.0,
        unit="kg",
        ge=0.0,
        le=2.4,
        step=0.001,
        description="what a flight on the estimate begins with, from the next arming on; "
        "0: model.mass; too large, it jumps off the ground",
    )

    def check_together(self) -> None:
        """Check the values against each other. Raises OutOfBoundsError."""
        if self.initial and not self.mass_min <= self.initial <= self.mass_max:
            raise OutOfBoundsError(
                f"mass.initial = {self.initial:g} kg is not between mass.mass_min = "
                f"{self.mass_min:g} and mass.mass_max = {self.mass_max:g} kg; 0 is model.mass"
            )


class FlownMass(MassEstimator):
    """The estimator of one vehicle, and whether its law is to fly on it.

    Args:
        model_mass: kg.

    Attributes:
        used: the law flies on the estimate.
    """

    def __init__(self, parameters: FlownMassParameters, model_mass: float) -> None:
        self.used = parameters.used_by == ESTIMATE
        self._start = parameters.initial or model_mass
        super().__init__(self._start if self.used else model_mass, parameters)

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError when a change of parameters may not act now."""
        present = ESTIMATE if self.used else MODEL
        if armed and values.get(USED_BY, present) != present:
            raise RefusedError(
                f"{USED_BY} stays {present} while armed, for the thrust would jump: "
                "land and disarm to change it"
            )

    def follow(self, parameters: FlownMassParameters, model_mass: float, armed: bool) -> None:
        """Take the present parameters; `check` has seen them."""
        self.configure(parameters)
        used, start = parameters.used_by == ESTIMATE, parameters.initial or model_mass
        changed = (used, start) != (self.used, self._start)
        self.used, self._start = used, start
        if changed and used and not armed:
            self.reset(start)

    def begin_flight(self) -> None:
        """Begin a flight at arming: what the last flight's end made of the estimate is not flown
        on.
        """
        if self.used:
            self.reset(self._start)
