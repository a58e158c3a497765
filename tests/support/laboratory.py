"""An experiment and its vehicle in simulated time, with a log."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from console.experiments.catalogue import find
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadrotor.parameters import ParameterStore
from vehicle.simulator.simulated_vehicle import SimulatedVehicle


@contextmanager
def laboratory(name: str, log: Path, **settings: Any) -> Iterator[tuple[Any, SimulatedFlight]]:
    """Yield the experiment and its flight; in a setting, __ stands for each dot of its name."""
    experiment = find(name)
    parameters = with_groups(
        FlightParameters().model_copy(deep=True), {"experiment": experiment.parameters}
    )
    ParameterStore(parameters).preset({k.replace("__", "."): v for k, v in settings.items()})
    robot = SimulatedVehicle(parameters.simulator)
    writer = FlightLog(log, "quad1", ParameterStore(parameters), {"run_id": name})
    try:
        yield experiment, SimulatedFlight(parameters, robot, writer)
    finally:
        writer.close()
