"""The mass the control law uses: the model's, or the estimate of Sec. 5.4.

The choice is made on the ground: in flight the two may differ, and the thrust would jump by the
difference.
"""

from __future__ import annotations

from collections.abc import Mapping

from estimation.identification.mass_estimator import MassEstimator
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from vehicle.flight_parameters import ESTIMATE, MODEL, FlownMassParameters

USED_BY = "mass.used_by"


class FlownMass(MassEstimator):
    """The mass estimator of one vehicle, and whether its control law uses the estimate.

    Args:
        model_mass: kg.

    Attributes:
        used: whether the control law uses the estimate.
    """

    def __init__(self, parameters: FlownMassParameters, model_mass: float) -> None:
        self.used = parameters.used_by == ESTIMATE
        self._start = parameters.initial or model_mass
        super().__init__(self._start if self.used else model_mass, parameters)

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError when a change of parameters is not allowed now."""
        present = ESTIMATE if self.used else MODEL
        if armed and values.get(USED_BY, present) != present:
            raise RefusedError(
                f"{USED_BY} stays {present} while armed, because the thrust would jump: "
                "land and disarm to change it"
            )

    def follow(self, parameters: FlownMassParameters, model_mass: float, armed: bool) -> None:
        """Apply the present parameters, which `check` has accepted."""
        self.configure(parameters)
        used, start = parameters.used_by == ESTIMATE, parameters.initial or model_mass
        changed = (used, start) != (self.used, self._start)
        self.used, self._start = used, start
        if changed and used and not armed:
            self.reset(start)

    def begin_flight(self) -> None:
        """Begin a flight at arming, without the estimate left by the end of the last flight."""
        if self.used:
            self.reset(self._start)
