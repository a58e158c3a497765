"""The parameters in use: checked by each part they concern, set, and passed to all parts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from bearing_sim.beacons import parse_layout
from control.behaviors.machine import BehaviorMachine
from control.keep_out import COLUMN, check_around
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from vehicle.behaviors.behaviors import OwnBehaviors
from vehicle.boards.imu import ImuCalibrator
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import ModelInUse
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.modes import FLYING
from vehicle.parameters import VehicleParameters, check_hover, check_pairs
from vehicle.safety.ground_contact import GroundContact
from vehicle.sensors.sensors import OwnSensors
from vehicle_link.parameters.change import VEHICLE, ParameterChange
from vehicle_link.parameters.last_change import LastChange

BOXES = ("keep_out", "keep_out_margin")
ROUNDING = 1e-9
"""Fraction of a step by which a value computed by the page may exceed it (rounding)."""


def check_steps(store: ParameterStore, values: Mapping[str, ParameterValue]) -> None:
    """Check the size of each change made in flight; `values` as from `store.check`.

    A gain or a mass acts on the motors in the next tick, so a slip of the hand would be a jolt.
    Raises RefusedError that names the first one that changes too much, and the allowed range.
    """
    for name, value in values.items():
        description, present = store.description(name), store.get(name)
        step = description.flight_step
        if step is None or abs(float(value) - float(present)) <= step * (1.0 + ROUNDING):
            continue
        unit = f" {description.unit}" if description.unit else ""
        low, high = float(present) - step, float(present) + step
        if description.minimum is not None:
            low = max(low, description.minimum)
        if description.maximum is not None:
            high = min(high, description.maximum)
        steps = math.ceil(abs(float(value) - float(present)) / step * (1.0 - ROUNDING))
        raise RefusedError(
            f"{name} = {value:g} is too far from {present:g} in flight: {low:g} to {high:g}{unit} "
            f"at once; go there in {steps} steps, or land"
        )


@dataclass(kw_only=True, eq=False)
class Configuration:
    """Parameters of one flight stack, which are changed between two ticks.

    Attributes:
        store: the vehicle's parameters, written here only.
        last_change: what a person changed last in this flight.
    """

    parameters: VehicleParameters
    tick: TickRecord
    outbox: Outbox
    modes: ModeMachine
    ground: GroundContact
    model: ModelInUse
    law: ControlLaw
    mass: FlownMass
    behaviors: BehaviorMachine
    own_behaviors: OwnBehaviors
    own_sensors: OwnSensors
    navigation: Navigation
    guard: BearingsGuard
    imu_calibrator: ImuCalibrator

    def __post_init__(self) -> None:
        self.store = ParameterStore(self.parameters)
        self.last_change = LastChange()
        self._layout = self.parameters.beacons.layout
        self.configure()

    def check(self, values: Mapping[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Return the values to set, with those that must change along with them.

        Raises QuadlabError.
        """
        store = self.store
        checked = {name: store.check(name, value) for name, value in values.items()}
        together = store.values() | checked
        check_pairs(together)
        if any(name.startswith("model.") for name in checked):
            check_hover(together)
        if self.ground.airborne:
            check_steps(store, checked)
        self._check_boxes(checked)
        flying = self.modes.mode in FLYING
        self.law.check(checked, flying)
        self.own_behaviors.check(checked, flying)
        self.own_sensors.check(checked, flying)
        self.mass.check(checked, flying)
        self.guard.check(checked, flying)
        return checked | self.navigation.check(checked, self.tick.state, flying)

    def _check_boxes(self, checked: Mapping[str, ParameterValue]) -> None:
        """Check that no new keep-out box is around the vehicle. Raises RefusedError."""
        present = self.parameters.behavior
        wanted = present.model_copy(
            update={f: checked[n] for f in BOXES if (n := f"behavior.{f}") in checked}
        )
        x, y, z = self.tick.position_w.tolist()
        if wanted == present or not math.isfinite(x + y + z):
            return
        top = z if self.ground.airborne else z + COLUMN
        new, old = ((p.boxes, p.keep_out_margin) for p in (wanted, present))
        check_around(*new, *old, ((x, y, z), (x, y, top)))

    def apply(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> dict[str, ParameterValue]:
        """Set checked parameters, configure every part, and report each change."""
        old = {name: self.store.get(name) for name in values}
        applied = self.store.set(values)
        self.configure()
        for name, value in applied.items():
            change = ParameterChange(
                stamp_ns=self.tick.stamp_ns,
                name=name,
                old=old[name],
                new=value,
                requester=requester,
                revision=self.store.revision,
            )
            self.outbox.add(change)
            if self.ground.airborne:
                self.last_change.note(change)
        return applied

    def apply_own(self, values: Mapping[str, ParameterValue]) -> None:
        """Apply a change that the vehicle makes by itself; values already in use are left out."""
        present = self.store.get
        self.apply({name: v for name, v in values.items() if v != present(name)}, VEHICLE)

    def configure(self) -> None:
        """Pass the present parameters to every part; called at a tick boundary."""
        p = self.parameters
        self.mass.follow(p.mass, p.model.mass, self.modes.mode in FLYING)
        self.law.configure(p.control, p.model)
        self.own_behaviors.configure(p.behavior.plugin)
        self.own_sensors.configure(p.estimation.sensors)
        self.model.fly_on(self.mass.mass if self.mass.used else p.model.mass)
        self.behaviors.set_model(self.law.model)
        if p.beacons.layout != self._layout:
            self._layout = p.beacons.layout
            self.navigation.place(parse_layout(self._layout))
        self.navigation.configure(p.estimation)
        self.guard.configure()
        self.imu_calibrator.configure(p.imu)
        chosen = (self.law.external, self.own_behaviors.external)
        for plugin in (*chosen, *self.own_sensors.externals, *self.navigation.externals):
            if plugin is not None:
                plugin.give(dict(getattr(p.plugins, plugin.name, ())))
        self.tick.status["parameter_revision"] = self.store.revision
        self.behaviors.set_control(p.control)
