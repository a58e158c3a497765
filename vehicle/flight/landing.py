"""Lift-off, touch-down, and the time on the ground with motors idling."""

from __future__ import annotations

from dataclasses import dataclass

from control.behaviors.ground import rest_reference
from control.behaviors.machine import BehaviorMachine
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import LANDING
from vehicle.flight.modes import Mode
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.parameters import VehicleParameters
from vehicle.safety.ground_contact import GroundContact


@dataclass(kw_only=True, eq=False)
class Landing:
    """The end of a flight, and the wait before the next one."""

    parameters: VehicleParameters
    tick: TickRecord
    outbox: Outbox
    modes: ModeMachine
    ground: GroundContact
    behaviors: BehaviorMachine
    law: ControlLaw

    def watch(self, dt: float) -> None:
        """Detect lift-off and touch-down, after a tick of dt (s) in which the behavior flew."""
        ground, tick, p = self.ground, self.tick, self.parameters
        landing = self.behaviors.name in LANDING
        if ground.airborne:
            lift, thrust = tick.specific_force_b.item(2), tick.wrench.item(0)
            ground.observe(lift, thrust, p.safety.landing_support, dt)
        elif not landing:
            ground.rise(float(tick.state["position_w"][0, 2]))
        carried = landing and ground.carried >= p.behavior.landing_dwell
        if (carried or self.behaviors.landed) and ground.touch_down(tick.stamp_ns):
            self.behaviors.reset()
            self.law.controller.reset()
            self.outbox.say("touched down")

    def idle(self) -> None:
        """Idle while armed on the ground: motors turn slowly, the reference follows the state."""
        tick = self.tick
        rest_reference(tick.state, tick.reference)
        self.law.controller.idle(tick.actuators)
        delay = self.parameters.safety.disarm_after_landing
        if self.ground.rested(tick.stamp_ns) >= delay:
            self.modes.move(Mode.READY, "landed")
