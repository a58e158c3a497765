"""The vehicle model in use, which follows the estimated mass and the battery."""

from __future__ import annotations

from dataclasses import dataclass

from control.behaviors.machine import BehaviorMachine
from control.behaviors.table import BehaviorName
from vehicle.boards.board import RawSample
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.flown_mass import FlownMass
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.tick_record import TickRecord
from vehicle.modes import DIRECT, FLYING
from vehicle.safety.ground_contact import GroundContact

LANDING = (BehaviorName.LAND, BehaviorName.EMERGENCY_LANDING)


@dataclass(kw_only=True, eq=False)
class ModelInUse:
    """Mass, model and disturbance shared by control law, feed-forward and touch-down."""

    tick: TickRecord
    modes: ModeMachine
    ground: GroundContact
    law: ControlLaw
    mass: FlownMass
    behaviors: BehaviorMachine

    def fly_on(self, mass: float) -> None:
        """Set the mass (kg) in use."""
        self.law.weigh(mass)
        self.behaviors.set_mass(mass)

    def step(self, sample: RawSample, since: float, dt: float) -> None:
        """Update the model after one tick.

        Args:
            since: s since the last tick.
            dt: the same, limited to the longest step of the laws.
        """
        tick, law, mass = self.tick, self.law, self.mass
        airborne = self.ground.airborne
        # The wrench is still that of the last tick, which acted until now.
        mass.step(tick.state, tick.actuators, self._weighs(airborne), since, tick.estimate)
        if mass.used:
            self.fly_on(mass.mass)
        if not law.observer.idle:
            # Disturbances are relative to the law's own command; ground reaction is not one.
            flying = airborne and self._direct and self.modes.mode in FLYING
            law.observe(tick.state, tick.actuators, flying, self._is_carried, dt)
        if law.follow_battery(sample.battery_voltage, dt):
            self.behaviors.set_model(law.model)

    @property
    def _direct(self) -> bool:
        """Return whether the thrusts are those of our control law, not the microcontroller's."""
        return self.modes.control_mode is DIRECT

    def _weighs(self, airborne: bool) -> bool:
        """Return whether only the commanded thrust carries the vehicle, as the estimate requires.

        An estimate that is only displayed depends on ground contact alone.
        """
        if not self.mass.used:
            return airborne
        return self._direct and airborne and not self._is_carried

    @property
    def _is_carried(self) -> bool:
        """Return whether the ground may carry a part of the weight."""
        is_presumed = self.ground.carried > 0.0 or self.behaviors.unloading > 0.0
        return is_presumed and self.behaviors.name in LANDING
