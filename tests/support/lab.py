"""Vehicle in simulated time, which the tests of the whole tick fly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Self

import numpy as np
import pytest

from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from tests.support.kept_log import KeptLog
from vehicle.behaviors.offer import offer_behaviors
from vehicle.flight.stack import FlightStack
from vehicle.laws.offer import offer_laws
from vehicle.modes import Flag
from vehicle.simulator.simulated_vehicle import SimulatedVehicle


def flight_parameters() -> FlightParameters:
    """Return the default parameters, which a test may change."""
    return FlightParameters().model_copy(deep=True)


class Lab(SimulatedFlight):
    """Flight whose truth and events a test can read.

    Args:
        parameters: default parameters if None.
        settings: parameters changed before the flight, by their full names.
        plugins: folder of control laws.
    """

    def __init__(
        self,
        parameters: FlightParameters | None = None,
        settings: Mapping[str, ParameterValue] | None = None,
        plugins: Path | None = None,
    ) -> None:
        parameters = parameters or flight_parameters()
        offer_laws(plugins)
        offer_behaviors(plugins)
        self.kept = KeptLog()
        self.robot = SimulatedVehicle(parameters.simulator)
        super().__init__(parameters, self.robot, self.kept, None, plugins)  # type: ignore[arg-type]
        if settings:
            self.change(dict(settings))

    def ready(self, settling: float = 0.2) -> Self:
        """Wait until the vehicle is ready and poses have arrived."""
        self.wait_until(lambda v: v.mode == "ready", what="ready", timeout=5)
        self.wait(settling)
        return self

    def hovering(self, height: float = 1.0, settling: float = 1.0, **take_off: float) -> Self:
        """Arm, take off, faster than people do, and let the vehicle settle."""
        self.ready().arm()
        self.wait(0.5)
        self.start("take_off", **{"height": height, "speed": 1.0} | take_off)
        self.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
        self.wait(settling)
        return self

    @property
    def height(self) -> float:
        """Return the true height in m."""
        return float(self.robot.truth["position_w"][0, 2])

    def error(self) -> float:
        """Return the distance between the true and the estimated position, in m."""
        estimated = self.stack.state["position_w"][0]
        return float(np.linalg.norm(estimated - self.robot.truth["position_w"][0]))

    @property
    def flags(self) -> Flag:
        """Return the flags of the status."""
        return Flag(int(self.stack.status["flags"][0]))

    @property
    def said(self) -> str:
        """Return the texts of all events so far, a line each."""
        return "\n".join(self.kept.texts)

    def texts(self) -> list[str]:
        """Return the texts of all events, with those of one more tick."""
        self.advance()
        return self.kept.texts


def refusal(action: Callable[[], object]) -> str:
    """Return the reason why `action` is refused."""
    with pytest.raises(RefusedError) as caught:
        action()
    return str(caught.value)


def shadow_state(stack: FlightStack) -> Record:
    """Return STATE (1,) of the shadow estimator, which must be there."""
    assert stack.navigation.running.shadow is not None
    return stack.navigation.running.shadow.state
