"""Built-in presets: gain sets of controller and estimator, and the defaults."""

from __future__ import annotations

from control.presets import PRESETS as CONTROL
from control.presets import preset_values
from estimation.parameters import PRESETS as ESTIMATION
from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.change import SIMULATOR, authority_of
from web.parameters.replica import LAYOUT, PageParameters

DEFAULTS, CALM = "defaults", "simulator defaults"
MEASURED = ("model.", "imu.", "beacons.layout", "behavior.keep_out", LAYOUT)
"""Parameters measured on this vehicle and in its room; the preset of defaults excludes them."""


def built_in(replica: PageParameters) -> dict[str, dict[str, ParameterValue]]:
    """Return the values of each preset by parameter; only of parameters that the vehicle has."""
    sets: dict[str, dict[str, ParameterValue]] = {}
    for name in CONTROL:
        sets[f"control {name}"] = preset_values(name)
    for name, poles in ESTIMATION.items():
        sets[f"estimation {name}"] = {f"estimation.{key}": v for key, v in poles.items()}
    known = {d.name for d in replica.descriptions()}
    defaults = {
        d.name: d.default
        for d in replica.descriptions()
        if not d.read_only and not d.name.startswith(MEASURED)
    }
    world = {name: v for name, v in defaults.items() if authority_of(name) == SIMULATOR}
    sets[DEFAULTS] = {name: v for name, v in defaults.items() if name not in world}
    sets[CALM] = world
    present = {
        name: {key: value for key, value in values.items() if key in known}
        for name, values in sets.items()
    }
    return {name: values for name, values in present.items() if values}
