"""Fly the references that another program sends, one after the other."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from control.behaviors.behavior import Behavior, Context, NoArguments, TickInputs
from control.behaviors.follow_trajectory import limits_of
from control.behaviors.table import BehaviorName
from control.keep_out import AROUND, first_encounter
from control.trajectories.extrapolation import extrapolate
from control.trajectories.feasibility import Survey
from control.trajectories.limits import QUANTITIES, WALLS
from control.trajectories.velocity_filter import BANDWIDTH
from quadrotor.errors import Refusal, RefusedError
from quadrotor.records import REFERENCE, Record, new_reference

YAW_STEP_MAX = 0.5
"""Largest step, in rad, of the yaw from the extrapolated last reference."""


class External(Behavior):
    """Behavior that flies the references of another program.

    Between two references the last one is extrapolated, at most for behavior.external_timeout. A
    reference is not flown if it is late, if it steps, if the vehicle could not fly it, or if its
    extrapolation during a silence could not be flown or would leave the flight volume or meet a
    keep-out box: then the vehicle brakes and hovers.

    Attributes:
        aborted: why it ended by itself.
    """

    name: ClassVar[BehaviorName] = BehaviorName.EXTERNAL

    def __init__(self, context: Context, arguments: NoArguments) -> None:
        p = context.parameters
        self._outside = context.outside
        self._timeout, self._step_max = p.external_timeout, p.external_step_max
        self._deceleration = p.brake_deceleration
        self._boxes, self._margin = p.boxes, p.keep_out_margin
        self._limits = limits_of(p, context.model)
        self._survey = Survey(context.model, self._limits)
        self._flown, self._flown_ns = new_reference(), -1
        self._now_and_later = np.zeros(2, REFERENCE)
        self.aborted = ""
        if problem := self._lateness(context.stamp_ns):
            raise RefusedError(f"external refused: {problem}", Refusal.NO_REFERENCE)
        here = _led_on(self._outside.reference, self._since(context.stamp_ns))
        if problem := self._breach(here, context.reference):
            raise RefusedError(f"external refused: {problem}")

    def step(self, tick: TickInputs, reference: Record) -> bool:
        stamp_ns = tick.stamp_ns
        outside = self._outside
        self.aborted = outside.failure or self._lateness(stamp_ns)
        if not self.aborted and outside.stamp_ns != self._flown_ns:
            wanted = _led_on(outside.reference, self._since(stamp_ns))
            self.aborted = self._breach(wanted, _led_on(reference, tick.dt))
            if not self.aborted:
                self._flown[:], self._flown_ns = outside.reference, outside.stamp_ns or 0
        if self.aborted or outside.has_ended:
            return True
        extrapolate(self._flown, (stamp_ns - self._flown_ns) * 1e-9, reference)
        return False

    def _since(self, stamp_ns: int) -> float:
        """Return the seconds from the newest reference's time to this one."""
        newest_ns = self._outside.stamp_ns
        return math.inf if newest_ns is None else (stamp_ns - newest_ns) * 1e-9

    def _lateness(self, stamp_ns: int) -> str:
        age = self._since(stamp_ns)
        if age == math.inf:
            return (
                "no reference was received on the topic external_reference; start publishing first"
            )
        # A stamp in the future is as wrong as an old one.
        if abs(age) > self._timeout:
            return (
                f"the newest reference of the topic external_reference is {age:.2f} s old; allowed "
                f"{self._timeout:g} s (behavior.external_timeout); send 20 a second or more"
            )
        return ""

    def _breach(self, wanted: Record, present: Record) -> str:
        """Return what is wrong with a reference, "" for nothing.

        Args:
            wanted, present: REFERENCE (1,) of one instant.
        """
        step = np.linalg.norm(wanted["position_w"][0] - present["position_w"][0])
        # Written so that a NaN is a breach.
        if not step <= self._step_max:
            x, y, z = present["position_w"][0].tolist()
            return (
                f"the reference is {step:.2f} m off the present one at ({x:.2f}, {y:.2f}, {z:.2f})"
                f" m; allowed {self._step_max:g} m (behavior.external_step_max)"
            )
        turn = (float(wanted["yaw"][0] - present["yaw"][0]) + math.pi) % math.tau - math.pi
        if not abs(turn) <= YAW_STEP_MAX:
            return f"the reference's yaw steps by {turn:.2f} rad; allowed {YAW_STEP_MAX:g} rad"
        later = self._now_and_later[1:]
        self._now_and_later[:1] = wanted
        extrapolate(wanted, self._timeout, later)
        found = self._survey
        found.run(self._now_and_later)
        for q in range(WALLS, len(QUANTITIES)):
            if found.first[q] >= 0:
                quantity = QUANTITIES[q]
                asked, most = (
                    quantity.sign * quantity.scale * float(one[q])
                    for one in (found.worst, found.limits)
                )
                return (
                    f"the reference asks for {quantity.name} = {asked:.2f} {quantity.unit}; "
                    f"allowed {most:.2f} ({quantity.source})"
                )
        stops, limits = self._stops(later), self._limits
        for axis, stop, low, high in zip("xyz", stops, limits.low_w, limits.high_w, strict=True):
            if not low <= stop <= high:
                return (
                    f"were it the last reference, the vehicle would stop at {axis} = {stop:.2f} m, "
                    f"outside the flight volume; allowed {low:g} to {high:g} m "
                    f"(behavior.volume_{axis}_min, behavior.volume_{axis}_max)"
                )
        path = [present["position_w"][0], *self._now_and_later["position_w"], stops]
        if near := first_encounter(self._boxes, path, self._margin, may_leave=True):
            return f"the reference, or where the vehicle would stop after it, is {near}; {AROUND}"
        return ""

    def _stops(self, reference: Record) -> list[float]:
        """Return x, y, z (m) where brake would stop, by integrating its filter's equation."""
        r, w = reference[0], BANDWIDTH
        out = []
        for i in range(3):
            p, v, a, j = (float(r[name][i]) for name in _MOTION)
            slewed = v + 3.0 * a / w
            out.append(
                p
                + slewed * abs(slewed) / (2.0 * self._deceleration)
                + 3.0 * v / w
                + 3.0 * a / w**2
                + j / w**3
            )
        return out


def _led_on(reference: Record, seconds: float) -> Record:
    out = new_reference()
    extrapolate(reference, seconds, out)
    return out


_MOTION = ("position_w", "velocity_w", "acceleration_w", "jerk_w")
