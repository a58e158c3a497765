"""The parameters in use: checked by each part they concern, set, and passed to all parts."""

from __future__ import annotations

import math
from collections.abc import Mapping

from bearing_sim.beacons import parse_layout
from control.behaviors.machine import BehaviorMachine
from quadrotor.errors import RefusedError
from quadrotor.parameters import ParameterStore, ParameterValue
from vehicle.calibration.imu import ImuCalibrator
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.flight.control_law import Steering
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import ModelInUse
from vehicle.flight.modes import FLYING
from vehicle.flight.outbox import Outbox
from vehicle.flight.tick_record import TickRecord
from vehicle.parameters import VehicleParameters, check_hover, check_pairs
from vehicle.safety.ground_contact import GroundContact
from vehicle_link.parameters.change import ParameterChange

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


class Configuration:
    """Parameters of one flight stack, which are changed between two ticks.

    Attributes:
        store: the vehicle's parameters, written here only.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        *,
        tick: TickRecord,
        outbox: Outbox,
        modes: ModeMachine,
        ground: GroundContact,
        model: ModelInUse,
        steering: Steering,
        mass: FlownMass,
        behaviors: BehaviorMachine,
        navigation: Navigation,
        guard: BearingsGuard,
        imu_calibrator: ImuCalibrator,
    ) -> None:
        self.store = ParameterStore(parameters)
        self._parameters, self._tick, self._outbox, self._modes = parameters, tick, outbox, modes
        self._ground, self._model, self._steering = ground, model, steering
        self._mass, self._behaviors, self._navigation = mass, behaviors, navigation
        self._guard, self._imu_calibrator = guard, imu_calibrator
        self._layout = parameters.beacons.layout
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
        if self._ground.airborne:
            check_steps(store, checked)
        flying = self._modes.mode in FLYING
        self._steering.check(checked, flying)
        self._mass.check(checked, flying)
        self._guard.check(checked, flying)
        return checked | self._navigation.check(checked, self._tick.state, flying)

    def apply(
        self, values: Mapping[str, ParameterValue], requester: str
    ) -> dict[str, ParameterValue]:
        """Set checked parameters, configure every part, and report each change."""
        old = {name: self.store.get(name) for name in values}
        applied = self.store.set(values)
        self.configure()
        for name, value in applied.items():
            self._outbox.add(
                ParameterChange(
                    stamp_ns=self._tick.stamp_ns,
                    name=name,
                    old=old[name],
                    new=value,
                    requester=requester,
                    revision=self.store.revision,
                )
            )
        return applied

    def configure(self) -> None:
        """Pass the present parameters to every part; called at a tick boundary."""
        p = self._parameters
        self._mass.follow(p.mass, p.model.mass, self._modes.mode in FLYING)
        self._steering.configure(p.control, p.model)
        self._model.fly_on(self._mass.mass if self._mass.used else p.model.mass)
        self._behaviors.set_model(self._steering.model)
        if p.beacons.layout != self._layout:
            self._layout = p.beacons.layout
            self._navigation.place(parse_layout(self._layout))
        self._navigation.configure(p.estimation)
        self._guard.configure()
        self._imu_calibrator.configure(p.imu)
        self._tick.status["parameter_revision"] = self.store.revision
        self._behaviors.set_control(p.control)
