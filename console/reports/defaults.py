"""Defaults of the parameters that the station's side knows; a log's own go before them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from quadrotor.parameters import ParameterValue

Defaults = Callable[[], Mapping[str, ParameterValue]]
"""Gives name → default; asked only when a log does not tell."""


def known_defaults() -> dict[str, ParameterValue]:
    """Return the known defaults, without those that only the vehicle's own code has."""
    # Compiled code comes with these.
    from bearing_sim.emulator import BearingParameters
    from bearing_sim.tracker import TrackerParameters
    from console.parameters.station import StationParameters
    from control.behaviors.parameters import BehaviorParameters
    from control.parameters import ControlParameters
    from estimation.identification.mass_estimator import MassParameters
    from estimation.parameters import EstimationParameters
    from quadrotor.parameters import Parameters, ParameterStore
    from quadrotor.vehicle_model import VehicleModel

    trees: dict[str, Parameters] = {
        "model": VehicleModel(),
        "control": ControlParameters(),
        "mass": MassParameters(),
        "estimation": EstimationParameters(),
        "behavior": BehaviorParameters(),
        "tracker": TrackerParameters(),
        "bearings": BearingParameters(),
        "station": StationParameters(),
    }
    return {
        f"{prefix}.{one.name}": one.default
        for prefix, tree in trees.items()
        for one in ParameterStore(tree).descriptions()
    }
