"""Parameters of the base station itself; the page and ROS 2 see them as `station.*`."""

from __future__ import annotations

from contextlib import suppress

from pydantic import Field

from bearing_sim.emulator import BearingParameters
from bearing_sim.tracker import TrackerParameters
from console.parameters.preflight import PreflightParameters
from quadrotor.errors import UsageError
from quadrotor.extension import StationPart
from quadrotor.extensions import registry
from quadrotor.parameters import Parameters, parameter, parameters_of


class RecorderParameters(Parameters):
    """The rules for the end of a run, and the space that the disk must keep free."""

    after_disarm: float = parameter(1.0, unit="s", ge=0, le=60, step=0.5)
    """a run continues for this long after disarming"""
    keep_free: float = parameter(500.0, unit="MB", ge=10, le=100000, step=10)
    """no recording below this"""
    warn_free: float = parameter(5000.0, unit="MB", ge=10, le=1000000, step=100)
    """a warning below this free space"""
    trash_keep: float = parameter(7.0, unit="d", ge=0.01, le=365, step=1)
    """deleted runs can be brought back for this long"""
    backfill: bool = parameter(True)
    """after each run, fetch what it lacks from the vehicle's own log"""
    pictures: float = parameter(5.0, unit="Hz", ge=0, le=10, step=1)
    """pictures a second of each camera that a run has at most; 0 records none"""


class StickParameters(Parameters):
    """The base station's watchdog over the sticks."""

    timeout: float = parameter(0.2, unit="s", ge=0.05, le=1, step=0.01)
    """sticks silent for longer are dropped"""


class StationParameters(Parameters):
    """The parameters of the station itself."""

    tracker: TrackerParameters = TrackerParameters()
    bearings: BearingParameters = BearingParameters()
    recorder: RecorderParameters = RecorderParameters()
    sticks: StickParameters = StickParameters()
    preflight: PreflightParameters = PreflightParameters()


def station_parameters() -> StationParameters:
    """Return new parameters of the station, with those of the parts that extensions add."""
    added = {}
    for name, offered in registry().offers(StationPart, StationParameters.model_fields).items():
        if offered.offer.parameters:
            with suppress(UsageError):  # told by the station, which makes the part
                kind = offered.load(offered.offer.parameters)
                added[name] = kind, kind()
    return parameters_of(StationParameters, "StationParameters", added)()


class StationTree(Parameters):
    """The root that gives every name its `station.` prefix."""

    station: StationParameters = Field(default_factory=station_parameters)
