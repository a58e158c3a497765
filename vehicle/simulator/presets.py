"""Named sets of simulator parameters: `--set simulator.preset=rough`."""

from __future__ import annotations

from quadrotor.errors import OutOfBoundsError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.simulator.parameters import SimulatorParameters

ROUGH: dict[str, ParameterValue] = {
    "vibration": 0.5,
    "vibration_gyroscope": 1.0,
    "rotor_drag_x": 0.42,
    "rotor_drag_y": 0.52,
    "drag_lever": 0.02,
    "inflow_loss": 0.025,
    "gust": 0.3,
    "gust_time": 1.5,
    "ground_effect": 1.0,
    "accelerometer_warm_up": 0.05,
    "gyroscope_warm_up": 0.3,
    "lost_samples": 0.003,
}
"""A vehicle in a laboratory with all effects that a clean simulation leaves out.

Rotor drag and inflow are fitted to 91 s of a Blackbird flight (MIT; clover, 5 m/s, 0.915 kg): drag
over mass 0.32 and 0.40 1/s along the body's axes (correlation of specific force and velocity -0.96
and -0.97), here times 1.308 kg, and a loss of 2.5 % of the thrust for each m/s of climb. The share
of lost samples is that of PX4 logs (0.0026, 0.0027 of sensor_combined). Above 15 Hz the
accelerometer has 0.1 m/s^2 in the Blackbird flight (100 Hz, filtered) and 1.3 to 6.8 in PX4 logs of
three flights, the gyroscope 0.4 and 1 to 10 deg/s: the figures here are those of a sound vehicle
between them. Lever, gusts and warm-up are assumptions, not fitted to data. The jitter of the
sampling clock is left out (docs/changing_parameters.md)."""

IDENTIFIED: dict[str, dict[str, ParameterValue]] = {
    "rough": {"model.drag": 0.47, "model.drag_lever": 0.02}
}
"""Values that the experiment `drag` finds on a vehicle in each of these worlds, which it then feeds
forward: who flies in air has identified its drag."""


def preset_values(name: str) -> dict[str, ParameterValue]:
    """Return all values of a set, by name: `clean` (the defaults) or `rough`.

    Raises OutOfBoundsError.
    """
    defaults = ParameterStore(SimulatorParameters()).values()
    clean = {key: defaults[key] for key in ROUGH}
    sets = {"clean": clean, "rough": clean | ROUGH}
    if name not in sets:
        raise OutOfBoundsError(f"no simulator is called {name!r}: there are {', '.join(sets)}")
    return sets[name]
