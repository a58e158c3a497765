"""An external law on a vehicle that hovers beside its reference, beside the built-in law alone."""

from __future__ import annotations

import numpy as np

from control.controller import GeometricController
from control.parameters import ControlParameters
from quadrotor.records import ACTUATORS, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel
from vehicle.laws.external import ExternalLaw

DT = 0.002


class LawBench:
    """Steps both laws.

    Args:
        law: is flown; its process is waited for.
        parameters: of both; None for the defaults.
    """

    def __init__(self, law: ExternalLaw, parameters: ControlParameters | None = None) -> None:
        self._law, self._built_in = law, GeometricController()
        parameters, model = parameters or ControlParameters(), VehicleModel().record()
        self._state, self._reference = new_state(), new_reference()
        self._reference["position_w"] = (0.1, 0.0, 0.0)
        self._flown, self._own = np.zeros(1, ACTUATORS), np.zeros(1, ACTUATORS)
        for one in (law, self._built_in):
            one.configure(parameters, model)
        law.flown = True
        law.becomes_ready()

    def ticks(self, count: int) -> None:
        """Step both laws; the integrals of the built-in one rest, as beneath an external one."""
        for _ in range(count):
            self._built_in.step(self._state, self._reference, False, DT, self._own)
            self._law.step(self._state, self._reference, True, DT, self._flown)

    @property
    def flies_built_in(self) -> bool:
        """Return whether the last tick flew what the built-in law commands, to the bit."""
        return self._flown.tobytes() == self._own.tobytes()
