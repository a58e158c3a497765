"""The rescue of a flight on an estimator that its measurements contradict, or on a plugin that
failed.

The shadow on the same measurements takes over in the tick in which the estimator in use is found
inconsistent, if it has itself converged, and hands back once the other has been consistent again
for a while. A tracker that jumps contradicts both, so it changes nothing. A plugin that failed is
not given the flight again.
"""

from __future__ import annotations

from estimation.convergence import difference
from estimation.names import NONE
from estimation.parameters import EstimationParameters
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.estimators.choice import ESTIMATOR, SAME, SHADOW, SHADOW_SOURCE, Change
from vehicle.estimators.external import ExternalEstimator
from vehicle.estimators.navigation import Navigation
from vehicle.estimators.readiness import AGREEMENT
from vehicle.modes import Flag

MEMORY, DOUBTED = 0.05, 0.5
"""Weight of the newest measurement in the share that the shadow did not agree with, and the share
above which it takes over nothing."""
HAND_BACK_NS = 2_000_000_000
"""Time for which the other must be consistent, converged and near before it gets the flight
back."""


class Rescue:
    """Judges the estimator in use after each measurement.

    Attributes:
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(
        self, parameters: EstimationParameters, navigation: Navigation, state: Record
    ) -> None:
        self._parameters, self._navigation, self._state = parameters, navigation, state
        self._before: dict[str, ParameterValue] = {}
        self._rescued: object = None
        self._good_since_ns: int | None = None
        self._shadow: object = None
        self._doubt = 1.0
        self.flags = 0

    def check(self, now_ns: int) -> Change | None:
        """Return the change that is due; called after measurements were taken, and in each tick
        while a plugin runs.
        """
        navigation, p = self._navigation, self._parameters
        if isinstance(navigation.active, ExternalEstimator) and navigation.active.failure:
            return self._without(navigation.active)
        if not navigation.measured:
            return None
        shadow = navigation.shadow_on_same_source
        if self._rescued is not None and (shadow is None or shadow.estimator is not self._rescued):
            self._end()  # another choice was made meanwhile
        if shadow is None or not p.rescue:
            return None
        if self._rescued is not None:
            return self._hand_back(now_ns)
        if shadow.estimator is not self._shadow:
            self._shadow, self._doubt = shadow.estimator, 1.0
        converged = shadow.estimator.converged
        self._doubt += MEMORY * ((not converged) - self._doubt)
        why = getattr(navigation.active, "inconsistency", "")
        if not why or not converged or self._doubt > DOUBTED:
            return None
        self._before = {SHADOW: p.shadow, SHADOW_SOURCE: p.shadow_source}
        self._rescued = navigation.active
        self._good_since_ns = None
        self.flags = int(Flag.RESCUED)
        values = {ESTIMATOR: shadow.name, SHADOW: p.estimator, SHADOW_SOURCE: SAME}
        apart = difference(shadow.state, self._state)
        line = f"{shadow.name} took over from {p.estimator}, {apart} apart: {why}"
        return Change(line, mailbox.WARN, values)

    def _without(self, plugin: ExternalEstimator) -> Change:
        built_in, p = plugin.built_in, self._parameters
        values: dict[str, ParameterValue] = {ESTIMATOR: built_in.name}
        if p.shadow == built_in.name and p.shadow_source in (SAME, built_in.source):
            values[SHADOW] = NONE
        line = f"estimator {plugin.name} disengaged, {built_in.name} took over: {plugin.failure}"
        return Change(line, mailbox.WARN, values)

    def _hand_back(self, now_ns: int) -> Change | None:
        shadow = self._navigation.shadow_on_same_source
        assert shadow is not None
        estimator = shadow.estimator
        good = (
            not getattr(estimator, "inconsistency", "")
            and estimator.converged
            and difference(shadow.state, self._state).within(AGREEMENT)
        )
        if not good:
            self._good_since_ns = None
            return None
        if self._good_since_ns is None:
            self._good_since_ns = now_ns
        if now_ns - self._good_since_ns < HAND_BACK_NS:
            return None
        values = {ESTIMATOR: shadow.name, **self._before}
        self._end()
        return Change(f"handed back to {shadow.name}: consistent again", mailbox.INFO, values)

    def _end(self) -> None:
        self._rescued, self.flags = None, 0
