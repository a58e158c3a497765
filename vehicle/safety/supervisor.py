"""The vehicle's own reactions to failures.

The supervisor has no side effects: it processes stamps and measurements, and returns a reaction
with its reason. Triggers, thresholds and reactions are parameters; docs/safety.md has their table.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from vehicle.modes import Flag
from vehicle.safety.parameters import SafetyParameters

_NEVER = -(1 << 62)
# Plain numbers, as an IntFlag costs half a microsecond per operation.
_LOST, _DEGRADED, _LOW = map(int, (Flag.LINK_LOST, Flag.LINK_DEGRADED, Flag.BATTERY_LOW))
_DEGREE = 3.141592653589793 / 180.0


class Reaction(IntEnum):
    """The reactions in order of severity; only a more severe one replaces another."""

    NONE = 0
    BRAKE = 1  # stop and hover
    LAND = 2  # land under control, which needs a pose
    DESCEND = 3  # descend level by the barometer, with angles held by the microcontroller
    EMERGENCY = 4  # the microcontroller lands on its own
    CUT = 5  # motors off


@dataclass(frozen=True, slots=True)
class Verdict:
    reaction: Reaction
    reason: str


@dataclass(slots=True)
class Situation:
    """The supervisor's inputs in one tick; one object is reused."""

    airborne: bool = False
    by_microcontroller: bool = False  # it holds the angles, without the estimate
    voltage: float = 16.0  # V
    pose_age: float = 0.0  # s
    innovation: float = 0.0  # m, distance of the newest pose from its prediction
    jumped: bool = False  # poses left their prediction suddenly: the tracker is wrong
    tilt: float = 0.0  # rad, angle between z_B and z_W
    speed: float = 0.0  # m/s
    outside: float = 0.0  # m beyond the flight volume
    box: str = ""  # a keep-out box nearer than half of its margin
    saturated: bool = False
    inertial: str = ""  # why the IMU is suspect
    lost_ports: int = 0


class Supervisor:
    """Monitor of a flight; each cause reacts at most once per flight.

    Attributes:
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(self, parameters: SafetyParameters) -> None:
        self._parameters = parameters
        self._received_ns = _NEVER
        self._received_since_ns: int | None = _NEVER  # start of unbroken reception; None: silent
        self._braked_ns: int | None = None
        self._since: dict[str, int] = {}  # cause -> stamp since which its condition has held
        self._said: set[str] = set()
        self.flags = 0
        self.battery_spent = False  # for long enough to react, whether flying or not

    def heartbeat(self, stamp_ns: int) -> None:
        """Note that the station's heartbeat arrived at this time of the vehicle's clock."""
        self._received_ns = max(self._received_ns, stamp_ns)

    def begin_flight(self) -> None:
        """Begin a flight at arming: every cause may react again."""
        self._said.clear()
        self._braked_ns = None

    def link_age(self, stamp_ns: int) -> float:
        """Return the seconds since the station's last heartbeat; inf before the first one."""
        return (
            float("inf") if self._received_ns == _NEVER else (stamp_ns - self._received_ns) * 1e-9
        )

    def step(self, stamp_ns: int, now: Situation) -> Verdict | None:
        """Return the most severe reaction due now, if any."""
        p = self._parameters
        self.flags = 0
        battery_due = self.battery_spent = self._battery_due(stamp_ns, now.voltage)
        link_age = self._watch_link(stamp_ns)
        if not now.airborne:
            return None
        # From the most severe to the mildest: the first that is due and has not reacted yet wins.
        verdict = self._on_the_tilt(stamp_ns, now.tilt / _DEGREE)
        if verdict is None and battery_due:
            verdict = self._once("battery", p.battery_reaction, f"battery at {now.voltage:.1f} V")
        if verdict is None and not now.by_microcontroller:
            verdict = self._on_the_estimate(stamp_ns, now)
        if verdict is None and (not now.by_microcontroller or now.pose_age <= p.pose_land_after):
            verdict = self._on_the_place(stamp_ns, now)
        if verdict is None and not now.by_microcontroller:
            verdict = self._on_the_motors(stamp_ns, now.saturated)
        if verdict is None and now.inertial:
            verdict = self._once("inertial", p.inertial_reaction, now.inertial)
        if verdict is None and now.lost_ports:
            verdict = self._once("port", p.port_reaction, "a serial port is lost")
        if verdict is None and link_age > p.link_timeout:
            verdict = self._link(stamp_ns, link_age)
        return verdict

    def _on_the_tilt(self, stamp_ns: int, tilt: float) -> Verdict | None:
        """Check the tilt, given in degrees."""
        p = self._parameters
        if tilt > p.tilt_cut:
            return self._once("cut", p.tilt_cut_reaction, f"turned over: tilt {tilt:.0f}°")
        if self._lasts("tilt", tilt > p.tilt_max, stamp_ns, p.tilt_delay):
            return self._once("tilt", p.tilt_reaction, f"tilt {tilt:.0f}°")
        return None

    def _on_the_estimate(self, stamp_ns: int, now: Situation) -> Verdict | None:
        """Check the causes that apply only while the estimate is in use."""
        p, verdict = self._parameters, None
        # A NaN must count as lost: comparisons with NaN are false.
        lost = not now.innovation <= p.innovation_max
        if self._lasts("diverged", lost, stamp_ns, p.innovation_delay):
            far = f"poses {now.innovation:.2f} m from their prediction for {p.innovation_delay:g} s"
            why = f"the {'tracker jumped' if now.jumped else 'estimate diverged'}: {far}"
            verdict = self._once("diverged", p.innovation_reaction, why)
        if verdict is None and self._without_pose(stamp_ns, now.pose_age):
            why = f"no pose measurement for {now.pose_age:.1f} s"
            verdict = self._once("pose", p.pose_reaction, why)
        return verdict

    def _without_pose(self, stamp_ns: int, pose_age: float) -> bool:
        """Return whether poses are missing on a working link.

        When the link returns after a second, a heartbeat may arrive a moment before the first pose,
        which then has `link_timeout` to follow; but an intermittent link does not extend the flight
        without poses beyond that of a lost link.
        """
        p = self._parameters
        if pose_age <= p.pose_land_after or self._received_since_ns is None:
            return False
        settled = (stamp_ns - self._received_since_ns) * 1e-9 > p.link_timeout
        return settled or pose_age > p.pose_land_after + p.link_land_after

    def _on_the_place(self, stamp_ns: int, now: Situation) -> Verdict | None:
        """Check the causes that apply while the position is known, in any control mode."""
        p, verdict = self._parameters, None
        if self._lasts("volume", now.outside > p.volume_margin, stamp_ns, p.volume_delay):
            why = f"{now.outside:.1f} m outside the flight volume"
            verdict = self._once("volume", p.volume_reaction, why)
        if self._lasts("box", bool(now.box), stamp_ns, p.volume_delay) and verdict is None:
            verdict = self._once("box", p.volume_reaction, f"in the keep-out box {now.box}")
        fast = self._lasts("speed", now.speed > p.speed_max, stamp_ns, p.speed_delay)
        if verdict is None and fast:
            verdict = self._once("speed", p.speed_reaction, f"{now.speed:.1f} m/s")
        return verdict

    def _on_the_motors(self, stamp_ns: int, saturated: bool) -> Verdict | None:
        p = self._parameters
        if not self._lasts("motors", saturated, stamp_ns, p.saturation_delay):
            return None
        why = f"motors saturated for {p.saturation_delay:g} s"
        return self._once("motors", p.saturation_reaction, why)

    def _watch_link(self, stamp_ns: int) -> float:
        age, timeout = self.link_age(stamp_ns), self._parameters.link_timeout
        if age > timeout:
            self.flags |= _LOST
            self._received_since_ns = None
            return age
        if self._received_since_ns is None:
            self._received_since_ns = stamp_ns
        if age > 0.75 * timeout:
            self.flags |= _DEGRADED
        else:
            self._braked_ns = None
            self._said.discard("link")
        return age

    def _link(self, stamp_ns: int, link_age: float) -> Verdict | None:
        p = self._parameters
        if self._braked_ns is None:
            self._braked_ns = stamp_ns
            why = f"no heartbeat from the station for {link_age:.2f} s"
            return self._once("link", p.link_reaction, why)
        if (stamp_ns - self._braked_ns) * 1e-9 >= p.link_land_after:
            why = f"still no heartbeat from the station after {link_age:.1f} s"
            return self._once("link land", p.link_land_reaction, why)
        return None

    def _battery_due(self, stamp_ns: int, voltage: float) -> bool:
        """Flag a low battery; return whether it was below the landing limit for long enough."""
        p = self._parameters
        low = voltage < max(p.battery_warning, p.battery_land)
        if not self._lasts("battery low", low, stamp_ns, p.battery_delay):
            return False
        self.flags |= _LOW
        return voltage < p.battery_land

    def _lasts(self, cause: str, holds: bool, stamp_ns: int, delay: float) -> bool:
        """Return whether a condition has held for `delay` (s)."""
        if not holds:
            self._since.pop(cause, None)
            return False
        return (stamp_ns - self._since.setdefault(cause, stamp_ns)) * 1e-9 >= delay

    def _once(self, cause: str, reaction: str, reason: str) -> Verdict | None:
        if cause in self._said:
            return None
        self._said.add(cause)
        chosen = Reaction[reaction.upper()]
        return None if chosen is Reaction.NONE else Verdict(chosen, reason)
