"""The entries and disturbances of the arena."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bearing_sim.tracker import TrackerParameters
from control.laws import extended, new_control_parameters
from control.parameters import GEOMETRIC, ControlParameters
from control.presets import preset_values
from extensions.laws.arena.own_laws import OwnLaw
from quadrotor.errors import UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from quadrotor.vehicle_model import VehicleModel
from vehicle.simulator.parameters import SimulatorParameters

OBSERVER = "observer"
KNOW_DRAG = ("flatness_indi", "nmpc")
"""Laws whose sources have the drag in their model."""


FEWER = {"nmpc": 3}
"""Divisors of the number of seeds, for laws whose flights take a hundred times as long."""


@dataclass(frozen=True)
class Entry:
    """A law with its settings.

    Attributes:
        knows_drag: whether the drag that an experiment would identify is in its model.
        own: a law of a user's file; None for one of quadlab or of an extension.
    """

    name: str
    law: str = GEOMETRIC
    settings: Mapping[str, ParameterValue] = field(default_factory=dict)
    knows_drag: bool = False
    own: OwnLaw | None = None

    def control(self) -> ControlParameters:
        """Return the parameters of the controller. Raises ParameterError."""
        control = new_control_parameters()
        ParameterStore(control).set({"law": self.law, **self.settings})
        return control


def entries(own: Mapping[str, OwnLaw] | None = None) -> dict[str, Entry]:
    """Return the paper's law without and with the disturbance observer, each other law, and users'
    own ones.
    """
    observer = {k.removeprefix("control."): v for k, v in preset_values(OBSERVER).items()}
    ours = Entry(GEOMETRIC), Entry(OBSERVER, settings=observer)
    others = (Entry(name, name, knows_drag=name in KNOW_DRAG) for name in extended())
    added = (Entry(name, name, own=law) for name, law in (own or {}).items())
    return {one.name: one for one in (*ours, *others, *added)}


def chosen(names: str, own: Mapping[str, OwnLaw] | None = None) -> list[Entry]:
    """Return the entries of these names; for none, all but users' own. Raises UsageError."""
    there = entries(own)
    for name in names.split():
        if name not in there:
            raise UsageError(f"--laws {name!r} is not in the arena; there are {', '.join(there)}")
    found = [there[name] for name in names.split() or entries()]
    for one in found:
        _ = one.own and one.own.law  # a mistake in a file is told before the first flight
    return found


@dataclass(frozen=True)
class Disturbance:
    """The difference of a vehicle and its air from the model.

    Attributes:
        truth: of `SimulatorParameters`.
        identified: of the model, for entries that know the drag.
        tracker: of `TrackerParameters`.
    """

    truth: Mapping[str, float] = field(default_factory=dict)
    identified: Mapping[str, float] = field(default_factory=dict)
    tracker: Mapping[str, float] = field(default_factory=dict)

    def tracked(self) -> TrackerParameters:
        """Return the tracker."""
        return TrackerParameters().model_copy(update=dict(self.tracker))

    def world(self) -> SimulatorParameters:
        """Return the true vehicle."""
        return SimulatorParameters().model_copy(update=dict(self.truth))

    def model(self, entry: Entry) -> VehicleModel:
        """Return the model that an entry has of it."""
        known = dict(self.identified) if entry.knows_drag else {}
        return VehicleModel().model_copy(update=known)


ROTOR_DRAG = {"rotor_drag_x": 0.42, "rotor_drag_y": 0.52, "drag_lever": 0.02}
WIND = {"drag": 0.3, "gust_time": 1.0}
ROUGH_SENSORS = {"accelerometer_noise": 0.5, "gyroscope_noise": 1.0}
ROUGH_TRACKER = {
    **{"rate": 50.0, "position_noise": 0.003, "attitude_noise": 0.5},
    **{"delay": 0.03, "drop_out": 0.05},
}
"""m/s^2 and deg/s each sample; Hz, m, deg, s, and the share of poses lost."""
DISTURBANCES = {
    "nominal": Disturbance(),
    "mass + 20 %": Disturbance({"payload": 0.262}),
    "drag": Disturbance(ROTOR_DRAG, {"drag": 0.47, "drag_lever": 0.02}),
    "wind 6 m/s, gusts": Disturbance(WIND | {"wind_x": 6.0, "gust": 1.0}, {"drag": 0.3}),
    "motor - 15 %": Disturbance({"motor_gain_left": 0.85}),
    "latency 20 ms": Disturbance({"command_latency": 0.02}),
    "mass + 50 %": Disturbance({"payload": 0.654}),
    "wind 12 m/s, gusts": Disturbance(WIND | {"wind_x": 12.0, "gust": 2.0}, {"drag": 0.3}),
    "low battery": Disturbance({"thrust_efficiency": 0.85}),
    "rough sensors": Disturbance(ROUGH_SENSORS, tracker=ROUGH_TRACKER),
}
"""Rotor drag is that of the preset `rough`; the wind acts through the drag of the body. A battery
at 14.0 V gives 85 % of the thrust at its nominal 15.2 V."""
