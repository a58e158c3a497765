"""An experiment flown in simulated time and evaluated from its log, as `quadlab fly` does."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from console.experiments import watched
from console.experiments.catalogue import find
from console.experiments.client import Calibrating, Result
from quadlab.simulated.experiment import with_options
from quadlab.simulated.flight import SimulatedFlight, TrueState
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.parameters import ParameterStore, ParameterValue
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

VEHICLE = "quad1"


@dataclass(frozen=True)
class Flown:
    """The outcome of an experiment; `proposal` only of a calibration."""

    result: Result
    proposal: CalibrationRecord | None

    def value(self, name: str) -> float:
        """Return a proposed parameter."""
        assert self.proposal is not None
        return float(self.proposal.values[name])


def fly(
    name: str,
    settings: dict[str, ParameterValue] | None = None,
    *,
    seed: int = 1,
    true_state: bool = False,
) -> Flown:
    """Fly the experiment. Raises QuadlabError.

    Args:
        settings: of vehicle, `simulator`, `tracker`, `experiment`.
    """
    experiment = find(name, VEHICLE)
    parameters = with_options(
        FlightParameters().model_copy(deep=True), {"experiment": experiment.parameters}
    )
    parameters.seed(seed)
    ParameterStore(parameters).preset(settings or {})
    experiment.check()
    robot = SimulatedVehicle(parameters.simulator)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.mcap"
        log = FlightLog(path, VEHICLE, ParameterStore(parameters), {"run_id": name})
        flight = SimulatedFlight(parameters, robot, log, TrueState(robot) if true_state else None)
        try:
            watched.fly(experiment, flight)
        finally:
            log.close()
        result = experiment.evaluate(path)
        if not isinstance(experiment, Calibrating):
            return Flown(result, None)
        return Flown(result, experiment.proposal(path))
