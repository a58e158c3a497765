"""The last act of a person on the parameters of a flight, and what takes it back."""

from __future__ import annotations

from quadrotor.parameter_description import ParameterValue
from vehicle_link.parameters.change import VEHICLE, ParameterChange, authority_of

TOGETHER_NS = 5_000_000_000
"""Longest time, ns, between two values of one parameter that are one act: a slider sends many."""


class LastChange:
    """The last act that changed the vehicle's parameters.

    Attributes:
        old: value of each parameter before that act.
    """

    def __init__(self) -> None:
        self.old: dict[str, ParameterValue] = {}
        self._stamp_ns = self._revision = 0

    def note(self, change: ParameterChange) -> None:
        """Note a change; what the vehicle changes by itself is no act of a person."""
        if change.requester == VEHICLE or authority_of(change.name) != VEHICLE:
            return
        goes_on = change.name in self.old and change.stamp_ns - self._stamp_ns <= TOGETHER_NS
        if not goes_on and (not self.old or change.revision != self._revision):
            self.old = {}
        self.old.setdefault(change.name, change.old)
        self._stamp_ns, self._revision = change.stamp_ns, change.revision

    def forget(self) -> None:
        """Forget it: another flight begins."""
        self.old = {}
