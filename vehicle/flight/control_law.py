"""The control law in use and its vehicle model, which follows the battery voltage and the mass.

A built-in law is changed on the ground only, as the integrals of one mean nothing to another. An
external law runs on top of a built-in one, and the two may be exchanged in flight.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from control.controller import Controller
from control.disturbance_observer import DisturbanceObserver
from control.parameters import NONE, ControlParameters, control_record
from control.rate_law import REFERENCE_MAX
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from quadrotor.vehicle_model import VehicleModel
from vehicle.laws.external import ExternalLaw
from vehicle.laws.laws import BUILT_IN, LAW, SHADOW_LAW, Laws, base_of

SETTLING = 1.0
"""s, time constant of the filtered battery voltage that the model follows (without ripple)."""
STEP = 0.05
"""Change of the voltage, in V, from which the model is updated: 0.3 % of a 4-cell battery."""


class ControlLaw:
    """The controller of one vehicle, its model and its disturbance observer.

    Args:
        control, model: parameters, read again by each `configure`.
        laws: the available laws.

    Raises RefusedError when the parameters name an unknown law.

    Attributes:
        model: MODEL, shape (1,), with the mass in use; updated in place, as others hold a view of
            it.
        mass: mass in use, kg.
        gains: CONTROL, shape (1,), of the parameters; updated in place.
        observer: the disturbance observer; off unless the parameters switch it on.
        external: the external law that is flown or runs as the shadow.
    """

    def __init__(
        self, control: ControlParameters, model: VehicleModel, laws: Laws | None = None
    ) -> None:
        self._laws = laws or Laws()
        self._laws.check(control.law, control.shadow_law)
        self._name, self._shadow = base_of(control.law), NONE
        self.external: ExternalLaw | None = None
        self._base_name = self._name
        self._base = BUILT_IN[self._base_name]()
        self.controller: Controller = self._base
        self._voltage: float | None = None  # V, filtered; None before the first reading
        self._modelled: float | None = None  # V, the voltage the model was made for
        self.mass = model.mass
        self.gains = control_record(control)
        self.observer = DisturbanceObserver(control.disturbance)
        self.configure(control, model)

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError when a change of parameters is not allowed now."""
        law = str(values.get(LAW, self._name))
        shadow = str(values.get(SHADOW_LAW, self._shadow))
        if (law, shadow) == (self._name, self._shadow):
            return
        self._laws.check(law, shadow)
        if not armed:
            return
        external = self.external
        if shadow not in (self._shadow, NONE):
            raise RefusedError(f"{SHADOW_LAW} is chosen on the ground: land and disarm first")
        if law == self._name:
            return
        if external is None or {law, self._name} != {external.name, self._base_name}:
            raise RefusedError(
                f"{LAW} stays {self._name} while armed: land and disarm to change it, or set "
                f"{SHADOW_LAW} before arming and change to that law in flight"
            )
        if law == external.name and not external.is_ready:
            raise RefusedError(f"law {law} cannot fly: {external.failure or 'it is loading'}")

    def configure(self, control: ControlParameters, model: VehicleModel) -> None:
        """Apply the present parameters, which `check` has accepted."""
        self._control, self._parameters = control, model
        self.gains[...] = control_record(control)
        self.mass = model.mass
        self.observer.configure(control.disturbance)
        if (control.law, control.shadow_law) != (self._name, self._shadow):
            self._name, self._shadow = control.law, control.shadow_law
            self._choose()
        self._remodel()

    def close(self) -> None:
        """Close the external law."""
        if self.external is not None:
            self.external.close()
            self.external = None

    def _choose(self) -> None:
        """Select the laws that the parameters name; those already running continue."""
        base_name = base_of(self._name)
        if base_name != self._base_name:
            self._base_name, self._base = base_name, BUILT_IN[base_name]()
        name = self._shadow if self._name in BUILT_IN else self._name
        external = self.external
        if external is not None and (external.name, external.base) != (name, self._base):
            self.close()
        if name != NONE and self.external is None:
            self.external = self._laws.start(name, self._base, self._control)
        if self.external is not None:
            self.external.flown = self._name == name
        self.controller = self.external or self._base

    def follow_battery(self, voltage: float, dt: float) -> bool:
        """Process one reading (V), `dt` (s) after the last; return whether the model changed."""
        if self._parameters.battery_exponent == 0.0 or not voltage > 0.0:
            return False
        if self._voltage is None:
            self._voltage = voltage
        self._voltage += (voltage - self._voltage) * -math.expm1(-dt / SETTLING)
        if self._modelled is not None and abs(self._voltage - self._modelled) < STEP:
            return False
        self._remodel()
        return True

    def observe(
        self, state: Record, actuators: Record, flying: bool, carried: bool, dt: float
    ) -> None:
        """Update the disturbance observer; see `control.disturbance_observer.observe_one`."""
        found = self.controller.disturbance
        self.observer.step(
            state=state,
            actuators=actuators,
            model=self.model,
            flying=flying,
            carried=carried,
            dt=dt,
            out=found,
        )

    def throttle(self, thrust: float) -> float:
        """Return the mean motor reference of a thrust (N), as a share (0 to 1) of its range."""
        m = self.model[0]
        reference = math.sqrt(max(0.0, 0.25 * thrust)) / m["motor_slope"] - m["motor_offset"]
        return min(1.0, max(0.0, float(reference) / REFERENCE_MAX))

    def weigh(self, mass: float) -> None:
        """Use this mass (kg) from now on, until the next `configure`."""
        if mass != self.mass:
            self.mass = mass
            self._model_mass[0] = mass
            self.controller.weigh(mass)

    def _remodel(self) -> None:
        self._modelled = self._voltage
        self.model: Record = self._parameters.record(self._voltage)
        self._model_mass = self.model["mass"]  # a view
        self._model_mass[0] = self.mass
        self.controller.configure(self._control, self.model)
