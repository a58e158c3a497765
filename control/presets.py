"""Named gain sets; their margins are computed (control.margins) rather than written here."""

from __future__ import annotations

from control.parameters import ControlParameters
from quadrotor.errors import OutOfBoundsError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.similar_names import did_you_mean

PRESETS: dict[str, dict[str, ParameterValue]] = {
    # The defaults: fly the paper's vehicle at any loop rate from 60 Hz.
    "standard": {},
    # Holds position better in wind and follows faster; needs 250 Hz and a clean estimate.
    "stiff": {
        "position.kp_xy": 6.0,
        "position.kv_xy": 4.5,
        "attitude.kr_xy": 100.0,
        "attitude.kw_xy": 17.0,
    },
    # Softer in position: smaller motions on a noisy estimate, larger errors in wind.
    "gentle": {
        "position.kp_xy": 2.0,
        "position.kv_xy": 2.6,
        "position.ki_xy": 0.4,
        "position.kp_z": 5.0,
        "position.kv_z": 4.0,
        "position.ki_z": 1.0,
    },
    # Wind, payload and a weak motor are estimated by the disturbance observer and subtracted. The
    # attitude integral is not needed then, and the observer's cost at the motors is compensated by
    # k_R.
    "observer": {
        "disturbance.force": True,
        "disturbance.torque": True,
        "attitude.kr_xy": 55.0,
        "attitude.ki_xy": 0.0,
        "attitude.ki_z": 0.0,
    },
    # The observer on stiff gains: half of its error in gusts and turbulence, for 20 ms of the delay
    # that the motors tolerate. Needs what `stiff` needs.
    "stiff_observer": {
        "disturbance.force": True,
        "disturbance.torque": True,
        "disturbance.force_bandwidth": 18.0,
        "position.kp_xy": 6.0,
        "position.kv_xy": 4.5,
        "attitude.kr_xy": 95.0,
        "attitude.kw_xy": 18.0,
        "attitude.ki_xy": 0.0,
        "attitude.ki_z": 0.0,
    },
    # Desired rates from the exact force: damped, but softer against a constant force by
    # 1 + k_w k_v / k_R.
    "damped": {"attitude.rates": "exact"},
}
"""Differences from the defaults of `ControlParameters`, by name."""
DECIDED = ("position.", "attitude.", "disturbance.")


def preset(name: str) -> ControlParameters:
    """Return the whole gain set. Raises OutOfBoundsError for an unknown name."""
    if name not in PRESETS:
        hint = did_you_mean(name, PRESETS, after=" ")
        raise OutOfBoundsError(
            f"no gain set is called {name!r}: {hint}there are {', '.join(PRESETS)}"
        )
    out = ControlParameters().model_copy(deep=True)
    for path, value in PRESETS[name].items():
        group, field = path.split(".")
        setattr(getattr(out, group), field, value)
    return out


def preset_values(name: str) -> dict[str, ParameterValue]:
    """Return all values that a gain set defines, by the vehicle's parameter names.

    These are gains and observer, not law and limits. Raises OutOfBoundsError for an unknown name.
    """
    values = ParameterStore(preset(name)).values()
    return {f"control.{key}": value for key, value in values.items() if key.startswith(DECIDED)}
