"""What the vehicle does by itself when something above or beside it fails.

Pure: fed with stamps and measurements, it answers with a reaction and its reason. The table of
triggers, thresholds and reactions is docs/safety.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from vehicle.modes import Flag
from vehicle.parameters import SafetyParameters

_NEVER = -(1 << 62)


class Reaction(Enum):
    BRAKE = "brake"
    LAND = "land"
    CUT = "cut"


@dataclass(frozen=True, slots=True)
class Verdict:
    reaction: Reaction
    reason: str


class Supervisor:
    """Watches link, pose, battery and tilt; one reaction a cause and flight."""

    def __init__(self, parameters: SafetyParameters) -> None:
        self._parameters = parameters
        self._heard_ns = _NEVER
        self._low_since_ns: int | None = None
        self._braked_ns: int | None = None
        self._said: set[str] = set()
        self.flags = Flag.NONE

    def heard(self, stamp_ns: int) -> None:
        """The station's heartbeat arrived at this time of the vehicle's clock."""
        self._heard_ns = max(self._heard_ns, stamp_ns)

    def begin_flight(self) -> None:
        """Called at arming: every cause may react again."""
        self._said.clear()
        self._braked_ns = None

    def link_age(self, stamp_ns: int) -> float:
        """Seconds since the station was heard; inf before the first time."""
        return float("inf") if self._heard_ns == _NEVER else (stamp_ns - self._heard_ns) * 1e-9

    def step(
        self, stamp_ns: int, *, airborne: bool, voltage: float, pose_age: float, tilt: float
    ) -> Verdict | None:
        """The reaction due now, if any.

        Args:
            voltage: V. pose_age: s. tilt: rad, angle between z_B and z_W.
        """
        p = self._parameters
        self.flags = Flag.NONE
        battery_due = self._battery_due(stamp_ns, voltage)
        link_age = self.link_age(stamp_ns)
        link_timeout = p.link_timeout
        if link_age > link_timeout:
            self.flags |= Flag.LINK_LOST
        elif link_age > 0.75 * link_timeout:
            self.flags |= Flag.LINK_DEGRADED
        else:
            self._braked_ns = None
            self._said.discard("link")
        if not airborne:
            return None
        if tilt > p.tilt_cut * _DEGREE:
            return self._once("tilt", Reaction.CUT, f"turned over: tilt {tilt / _DEGREE:.0f} deg")
        if battery_due and "battery" not in self._said:
            return self._once("battery", Reaction.LAND, f"battery at {voltage:.1f} V")
        if pose_age > p.pose_land_after and link_age <= link_timeout:
            return self._once("pose", Reaction.LAND, f"no pose measurement for {pose_age:.1f} s")
        if link_age > link_timeout:
            return self._link(stamp_ns, link_age)
        return None

    def _link(self, stamp_ns: int, link_age: float) -> Verdict | None:
        if self._braked_ns is None:
            self._braked_ns = stamp_ns
            return self._once("link", Reaction.BRAKE, f"station not heard for {link_age:.2f} s")
        if (stamp_ns - self._braked_ns) * 1e-9 >= self._parameters.link_land_after:
            return self._once(
                "link land", Reaction.LAND, f"station still not heard after {link_age:.1f} s"
            )
        return None

    def _battery_due(self, stamp_ns: int, voltage: float) -> bool:
        """Flags a low battery; whether it has been low enough to land for long enough."""
        p = self._parameters
        if voltage >= max(p.battery_warning, p.battery_land):
            self._low_since_ns = None
            return False
        if self._low_since_ns is None:
            self._low_since_ns = stamp_ns
        if (stamp_ns - self._low_since_ns) * 1e-9 < p.battery_delay:
            return False
        self.flags |= Flag.BATTERY_LOW
        return voltage < p.battery_land

    def _once(self, cause: str, reaction: Reaction, reason: str) -> Verdict | None:
        if cause in self._said:
            return None
        self._said.add(cause)
        return Verdict(reaction, reason)


_DEGREE = 3.141592653589793 / 180.0
