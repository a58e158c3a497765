"""Changes of parameters that the vehicle makes by itself.

It leaves an estimator that its measurements contradict, bearings that are not good enough to fly
on, a plugin that failed and, if it is told to, what made it oscillate.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import NONE as NO_PLUGIN
from control.behaviors.table import BehaviorName
from control.parameters import GEOMETRIC, NONE
from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue
from vehicle import mailbox
from vehicle.behaviors.behaviors import PARAMETER as BEHAVIOR
from vehicle.behaviors.behaviors import OwnBehaviors
from vehicle.estimators.bearings_guard import BearingsGuard
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.rescue import Rescue
from vehicle.flight.configuration import Configuration
from vehicle.flight.control_law import ControlLaw
from vehicle.flight.mode_machine import ModeMachine
from vehicle.flight.tick_record import Outbox, TickRecord
from vehicle.laws.laws import LAW, SHADOW_LAW
from vehicle.modes import DIRECT, FLYING, Flag, Mode
from vehicle.plugins.external import External
from vehicle.safety.oscillation import OscillationWatch
from vehicle.safety.supervisor import Reaction, Verdict
from vehicle.sensors.sensors import PARAMETER as SENSORS
from vehicle.sensors.sensors import OwnSensors
from vehicle_link.parameters.steps import step_towards

_OSCILLATING = int(Flag.OSCILLATING)
_JUDGED = frozenset(
    {
        BehaviorName.HOVER,
        BehaviorName.FLY_TO,
        BehaviorName.FOLLOW_TRAJECTORY,
        BehaviorName.VELOCITY,
        BehaviorName.BRAKE,
        BehaviorName.EXTERNAL,
    }
)
"""Behaviors whose reference is followed in the air; a test's steps are no oscillation."""
STEP_NS = 50_000_000
"""Time in ns between two steps towards a value that is restored."""


@dataclass(kw_only=True, eq=False)
class AutomaticChanges:
    """The six checks of one tick, each directly behind the step that it judges."""

    tick: TickRecord
    outbox: Outbox
    configuration: Configuration
    modes: ModeMachine
    navigation: Navigation
    rescue: Rescue
    guard: BearingsGuard
    law: ControlLaw
    own_behaviors: OwnBehaviors
    own_sensors: OwnSensors
    oscillation: OscillationWatch
    behaviors: BehaviorMachine
    _restoring: dict[str, ParameterValue] = field(default_factory=dict)
    _next_step_ns: int = 0

    def check_estimators(self) -> None:
        """Change to the shadow estimator, or back from it, when that is due."""
        navigation = self.navigation
        for external in navigation.externals:
            self._tell_news(external)
        if not (navigation.measured or navigation.externals):
            return
        change = self.rescue.check(self.tick.stamp_ns)
        if change is not None:
            self.outbox.say(change.why, change.level)
            self.configuration.apply_own(change.values)
            navigation.take_over(self.tick.state)

    def check_bearings(self) -> None:
        """End a flight on bearings as the guard requests."""
        if not self.guard.on:
            return
        change = self.guard.step(armed=self.modes.mode is Mode.ARMED)
        if change is None:
            return
        if change.values:
            self.outbox.say(change.why, change.level)
            self.configuration.apply_own(change.values)
        else:
            self.modes.land(change.why)

    def check_law(self) -> None:
        """Report when an external law is ready; disengage one that failed.

        In the tick of the failure the built-in law has already taken over.
        """
        law = self.law.external
        if law is None:
            return
        self._tell_news(law)
        if law.failure:
            flies = "took over" if law.flown else "flies on"
            line = f"law {law.name} disengaged, {GEOMETRIC} {flies}: {law.failure}"
            self.outbox.say(line, mailbox.WARN)
            self.configuration.apply_own({LAW: GEOMETRIC, SHADOW_LAW: NONE})

    def check_behavior(self) -> None:
        """Report when a behavior of the user's own is ready; disengage one that failed.

        In the tick of the failure the vehicle has already begun to brake.
        """
        behavior = self.own_behaviors.external
        if behavior is None:
            return
        self._tell_news(behavior)
        if behavior.failure:
            line = f"behavior {behavior.name} disengaged: {behavior.failure}"
            self.outbox.say(line, mailbox.WARN)
            self.configuration.apply_own({BEHAVIOR: NO_PLUGIN})

    def check_sensors(self) -> None:
        """Report when a sensor of the user's own is ready; disengage one that failed."""
        for sensor in self.own_sensors.externals:
            self._tell_news(sensor)
            if sensor.failure:
                line = f"sensor {sensor.name} disengaged: {sensor.failure}"
                self.outbox.say(line, mailbox.WARN)
                self.configuration.apply_own({SENSORS: self.own_sensors.without(sensor)})

    def check_oscillation(self, airborne: bool, dt: float) -> None:
        """Judge the flight along its reference, and react to an oscillation that begins.

        A restored value is reached in steps that are allowed in flight.
        """
        modes, watch, last = self.modes, self.oscillation, self.configuration.last_change
        flies = airborne and modes.control_mode is DIRECT and modes.mode is Mode.ARMED
        if not airborne and last.old:
            last.forget()
        before = watch.flags
        judged = flies and self.behaviors.name in _JUDGED
        watch.step(dt, self.navigation.source if judged else "")
        if not watch.flags & _OSCILLATING:
            self._restoring = {}
            return
        if not before & _OSCILLATING:
            reaction = self.configuration.parameters.safety.oscillation_reaction
            if reaction == "brake":
                modes.react(Verdict(Reaction.BRAKE, watch.cause))
            elif reaction == "restore" and last.old:
                self._restoring = dict(last.old)
                values = ", ".join(f"{name} = {value}" for name, value in last.old.items())
                self.outbox.say(f"restoring {values}", mailbox.WARN)
        if self._restoring and self.tick.stamp_ns >= self._next_step_ns:
            self._next_step_ns = self.tick.stamp_ns + STEP_NS
            self._restore()

    def _restore(self) -> None:
        """Make one step towards the values to be restored; a refusal ends it."""
        configuration = self.configuration
        store = configuration.store
        step = {
            name: step_towards(store.description(name).flight_step, store.get(name), value)
            for name, value in self._restoring.items()
            if value != store.get(name)
        }
        try:
            configuration.apply_own(configuration.check(step))
        except QuadlabError as error:
            self.outbox.say(f"not restored: {error}", mailbox.WARN)
            step = {}
        if not step:
            self._restoring = {}

    def _tell_news(self, plugin: External) -> None:
        """Report that it was loaded, and after a landing how it answered."""
        for line in plugin.news(self.modes.mode in FLYING):
            self.outbox.say(line)
