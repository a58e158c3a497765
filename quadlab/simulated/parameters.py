"""The parameters of a simulated flight: the vehicle's, and those of the simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.faults import bearings, tracker
from bearing_sim.tracker import TrackerParameters
from quadrotor.parameters import Parameters, parameters_of
from vehicle.parameters import VehicleParameters
from vehicle.simulator.faults import table
from vehicle.simulator.parameters import SimulatorParameters


class FlightParameters(VehicleParameters):
    """The vehicle's parameters and, next to them, those that only a simulated flight has."""

    simulator: SimulatorParameters = SimulatorParameters()
    tracker: TrackerParameters = TrackerParameters()
    bearings: BearingParameters = BearingParameters()

    def seed(self, seed: int) -> None:
        """Give every source of noise its own seed."""
        self.simulator.seed = seed
        self.tracker.seed = seed + 1_000_003
        self.bearings.seed = seed + 2_000_003


def with_groups(
    parameters: FlightParameters, groups: Mapping[str, Parameters | None]
) -> FlightParameters:
    """Return the tree with further groups of parameters, under these names.

    They are not copied: an experiment, for example, reads the same object.
    """
    there = {name: of for name, of in groups.items() if of is not None}
    fields: dict[str, Any] = {name: (type(of), of) for name, of in there.items()}
    tree = parameters_of(type(parameters), "ChosenParameters", fields)
    values: dict[str, Any] = dict(parameters) | there
    chosen: FlightParameters = tree.model_construct(**values)
    return chosen


def faults_to_come(parameters: FlightParameters, lasted: float) -> list[str]:
    """Return the faults whose schedules begin only after a flight of this duration (s)."""
    p = parameters
    entries = [
        *table.CATALOGUE.parse(p.simulator.faults, p.simulator),
        *tracker.CATALOGUE.parse(p.tracker.faults, p.tracker),
        *bearings.CATALOGUE.parse(p.bearings.faults, p.bearings),
    ]
    return [entry.text for entry in entries if entry.schedule.begin_ns > lasted * 1e9]
