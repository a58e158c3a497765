"""An experiment flown in simulated time and evaluated from its log, as `quadlab fly` does."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from console.experiments import watched
from console.experiments.catalogue import find
from console.experiments.client import Calibrating, Result
from quadlab.simulated.flight import SimulatedFlight, TrueState
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadrotor.calibration_record import CalibrationRecord
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.boards.kind import MIKROKOPTER, find_kind
from vehicle.simulator.boards import firmware_of
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

VEHICLE = "quad1"
REST_TO_REST: dict[str, ParameterValue] = {
    "experiment.laps": "rest_to_rest",
    "experiment.yaw_amplitude": 0.2,
}
"""Options of the experiment `figure_eight`: one lap of 8 s."""


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
    board: str = MIKROKOPTER,
) -> Flown:
    """Fly the experiment. Raises QuadlabError.

    Args:
        settings: of vehicle, `simulator`, `tracker`, `experiment`, `board`.
        board: the vehicle's board, one of those that can be simulated.
    """
    experiment, kind = find(name, VEHICLE), find_kind(board)
    options = kind.configured({})
    parameters = with_groups(
        FlightParameters().model_copy(deep=True),
        {"experiment": experiment.parameters, "board": options},
    )
    parameters.seed(seed)
    ParameterStore(parameters).preset(kind.simulated_parameters | (settings or {}))
    experiment.check()
    robot = SimulatedVehicle(parameters.simulator, firmware=firmware_of(board, options))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.mcap"
        log = FlightLog(path, VEHICLE, ParameterStore(parameters), {"run_id": name})
        estimator = TrueState(robot) if true_state else None
        flight = SimulatedFlight(parameters, robot, log, estimator, kind=kind)
        try:
            watched.fly(experiment, flight)
        finally:
            log.close()
            robot.close()
        result = experiment.evaluate(path)
        if not isinstance(experiment, Calibrating):
            return Flown(result, None)
        return Flown(result, experiment.proposal(path))
