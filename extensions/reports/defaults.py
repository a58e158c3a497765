"""Defaults of the parameters known on the station; those in a log take precedence."""

from __future__ import annotations

from quadrotor.parameter_description import ParameterValue


def known_defaults() -> dict[str, ParameterValue]:
    """Return the known defaults, without those defined in the vehicle's own code."""
    # Imported here: they load compiled code.
    from bearing_sim.emulator import BearingParameters
    from bearing_sim.tracker import TrackerParameters
    from console.parameters.station import station_parameters
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
        "station": station_parameters(),
    }
    return {
        f"{prefix}.{one.name}": one.default
        for prefix, tree in trees.items()
        for one in ParameterStore(tree).descriptions()
    }
