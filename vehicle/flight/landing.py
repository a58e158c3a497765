"""Lift-off, touch-down, and the time on the ground with motors idling."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from control.behaviors.ground import rest_reference
from control.behaviors.machine import BehaviorMachine
from quadrotor.vehicle_model import GRAVITY
from vehicle import mailbox
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.model_in_use import LANDING
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.modes import Mode
from vehicle.parameters import VehicleParameters
from vehicle.safety.barometric_height import BarometricHeight
from vehicle.safety.ground_contact import GroundContact
from vehicle.safety.unloading import Unloading, Verdict

STOPPED, STOPPED_LONGER = 0.3, 0.05
"""A descent at less than this share of the commanded speed is not flown; time, in s, for which it
must show beyond that of the other witnesses, as a touch-down slows the vehicle first."""
LEAST_DESCENT = 0.1
"""Commanded descent, in m/s, from which on this shows."""
LOW, LOW_BY_BAROMETER = 0.1, 0.5
"""Heights over the place of arming, in m, by the estimate and by the barometer, below both of which
a take-off is aborted by motors off: the estimate rests on the poses that are in doubt."""
AGAIN = 0.5
"""Time, in s, from the start and from a test that found the air, in which this shows nothing."""
BLOW, BLOW_LASTS = 0.35, 1.0
"""Specific force, in g, beyond that of the thrust, which a touch-down gives and moving air does
not; time, in s, for which it presumes the ground, which the vehicle may leave again meanwhile."""

BLIND = 1.0
"""Time, in s, for which a commanded descent must not be flown where the accelerometer is stuck: no
test can show the ground then."""


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
    altitude: BarometricHeight
    unloading: Unloading = field(default_factory=Unloading)
    stopped: float = 0.0
    """Time, in s, for which a commanded descent has not been flown."""
    since_blow: float = math.inf
    """Time, in s, since the ground hit the feet last."""
    try_at: float = 0.0
    """Value of `since_blow` from which on the blow presumes the ground."""

    def watch(self, dt: float) -> None:
        """Detect lift-off and touch-down, after a tick of dt (s) in which the behavior flew."""
        ground, tick, behaviors = self.ground, self.tick, self.behaviors
        landing = behaviors.name in LANDING
        if not ground.airborne:
            if not landing:
                ground.rise(float(tick.state["position_w"][0, 2]))
            is_down = behaviors.landed
        else:
            is_down = self._is_down(landing, dt)
        if is_down and ground.touch_down(tick.stamp_ns):
            behaviors.reset()
            self.law.controller.reset()
            self.outbox.say("touched down")

    def _is_down(self, landing: bool, dt: float) -> bool:
        """Return whether a vehicle that was in the air is on the ground: a touch-down that one
        witness shows is tested by taking thrust away.
        """
        ground, test, p = self.ground, self.unloading, self.parameters
        lift, thrust = self.tick.specific_force_b.item(2), self.tick.wrench.item(0)
        per_newton = ground.lift_per_newton or GRAVITY / self.behaviors.hover_thrust
        test.observe(lift, per_newton * thrust, dt)
        self.since_blow += dt
        if not test.is_running:
            ground.observe(test.lift, thrust, p.safety.landing_support, dt)
            if not landing:
                self.stopped, self.since_blow = -AGAIN, math.inf
                return False
            if not self._is_presumed(dt):
                return False
            if test.is_blind:
                return self.stopped >= BLIND
        verdict = test.step(dt) if landing and not test.is_blind else Verdict.AIR
        if verdict is not Verdict.OPEN:
            test.end()
        self.behaviors.unloading = test.share
        if verdict is Verdict.AIR and landing:
            ground.refute()
            self.stopped = -AGAIN
            self.try_at = self.since_blow + self.parameters.behavior.landing_dwell
            self.outbox.say("not on the ground: the vehicle sank with less thrust; descending on")
        return verdict is Verdict.GROUND

    def _is_presumed(self, dt: float) -> bool:
        """Return whether one witness shows the ground: little thrust and yet a steady velocity,
        more lift than the thrust gives, a blow, or a descent that is commanded and not flown.

        A blow beyond the accelerometer's range leaves the climb rate wrong, so that the descent
        seems to be flown.
        """
        tick, dwell = self.tick, self.parameters.behavior.landing_dwell
        if (level := self.behaviors.level) is None:
            wanted, flown = (s["velocity_w"].item(2) for s in (tick.reference, tick.state))
        else:
            wanted, flown = level.climb or 0.0, self.altitude.climb
        most = LEAST_DESCENT if self.unloading.is_blind else math.inf  # no test follows
        is_stopped = wanted < -LEAST_DESCENT and STOPPED * wanted < flown < most
        waits = self.stopped < 0.0 or is_stopped
        self.stopped = self.stopped + dt if waits else 0.0
        if self.unloading.unexplained > BLOW * GRAVITY:
            self.since_blow, self.try_at = 0.0, dwell
        return (
            self.behaviors.landed
            or self.try_at <= self.since_blow < BLOW_LASTS
            or self.ground.carried >= dwell
            or self.stopped >= dwell + STOPPED_LONGER
        )

    def abort_take_off(self, why: str) -> None:
        """Switch the motors off unless the vehicle has left the ground, whose height a tracker may
        show with the wrong sign.
        """
        ground = self.ground
        height = abs(float(self.tick.state["position_w"][0, 2]) - ground.ground_z)
        is_low = height < LOW and self.altitude.height < LOW_BY_BAROMETER
        on_ground = not ground.airborne or is_low
        if on_ground and self.behaviors.name not in LANDING:
            self.modes.move(Mode.READY, f"motors off: {why}", mailbox.ERROR)

    def idle(self) -> None:
        """Idle while armed on the ground: motors turn slowly, the reference follows the state."""
        tick = self.tick
        self.unloading.end()
        rest_reference(tick.state, tick.reference)
        self.law.controller.idle(tick.actuators)
        delay = self.parameters.safety.disarm_after_landing
        if self.ground.rested(tick.stamp_ns) >= delay:
            self.modes.move(Mode.READY, "landed")
