"""Sensors of extensions in a flight in simulated time, which replace the emulated ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar

from bearing_sim.emulator import BearingMeasurement
from bearing_sim.pose_measurement import PoseMeasurement
from quadlab.simulated.parameters import FlightParameters, with_groups
from quadrotor.errors import UsageError
from quadrotor.extension import SimulatedSensor
from quadrotor.extensions import Offered, registry
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, ParameterStore
from quadrotor.plain_rotations import Array

Measured = TypeVar("Measured")


class Source(Protocol[Measured]):
    """A sensor that measures the true pose of the vehicle."""

    def observe(self, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Observe the true pose: (3,) m, world axes, and (4,) body to world."""
        ...

    def due(self, now_ns: int) -> list[Measured]:
        """Return the measurements that have arrived by `now_ns`, in order."""
        ...

    @property
    def next_ns(self) -> int | None:
        """Return when the next measurement arrives, None if there is none on its way."""
        ...


class Sensor(Source[Measured], Protocol[Measured]):
    """A sensor of an extension."""

    def shown(self) -> list[tuple[str, int, bytes]]:
        """Return topics, stamps and JPEGs of the pictures for people since the last call."""
        ...

    def said(self) -> list[str]:
        """Return lines about the problems since the last call."""
        ...


class Replacements(NamedTuple):
    """Sensors instead of the simulated tracker, and of the emulated bearings."""

    poses: Sensor[PoseMeasurement] | None = None
    bearings: Sensor[BearingMeasurement] | None = None


Make = Callable[[FlightParameters, Parameters, Array], Replacements]
"""A function of the parameters of the flight and of the sensor, and of the vehicle's estimated
position, a view that shows its current value."""


def new_flight_parameters() -> FlightParameters:
    """Return the defaults, with a group for each sensor of an extension."""
    groups: dict[str, Parameters | None] = {}
    for name, offered in _offered().items():
        try:
            groups[name] = offered.load(offered.offer.parameters)()
        except UsageError as error:  # all else flies
            registry().problems[str(error)] = None
    return with_groups(FlightParameters().model_copy(deep=True), groups)


def new_defaults() -> dict[str, ParameterValue]:
    """Return the default of every parameter by name; the station's begin with `station.`."""
    from console.parameters.station import StationTree

    trees = (new_flight_parameters(), StationTree())
    return {one.name: one.default for tree in trees for one in ParameterStore(tree).descriptions()}


def replacements(parameters: FlightParameters, estimated_w: Array) -> Replacements:
    """Return the sensors that the parameters choose. Raises QuadlabError."""
    poses = bearings = None
    for name, offered in _offered().items():
        if (own := getattr(parameters, name, None)) is not None:
            make: Make = offered.load()
            made = make(parameters, own, estimated_w)
            poses, bearings = made.poses or poses, made.bearings or bearings
    return Replacements(poses, bearings)


def _offered() -> dict[str, Offered[SimulatedSensor]]:
    taken = (*FlightParameters.model_fields, "board", "experiment")  # groups that a flight adds
    return registry().offers(SimulatedSensor, taken=taken)
