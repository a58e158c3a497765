"""Offboard flight: set-points of a ground station as references of the behavior `external`.

A set-point may be anywhere, but a reference must be flyable and must not step. So a reference of
our own follows the set-points: its velocity is the set-point's, plus a share of the way that is
left, and it passes through the filter of the sticks (control.trajectories.velocity_filter), which
also stops it at the walls of the flight volume and at keep-out boxes. The vehicle checks each
reference as always. When set-points stop, references stop, and the vehicle brakes and hovers
(docs/safety.md).
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from control.behaviors.parameters import BehaviorParameters
from control.behaviors.velocity import set_walls
from control.trajectories.extrapolation import extrapolate
from control.trajectories.velocity_filter import advance, new_velocity_filter
from extensions.mavlink.commands import world_point
from extensions.mavlink.dialect import MAVLink_message, mavlink
from extensions.mavlink.frames import Origin, Vector, swap_world, swap_yaw
from extensions.mavlink.vehicle import Vehicle
from quadrotor.errors import Refusal, RefusedError
from quadrotor.parameters import section_of
from quadrotor.records import Record, new_reference
from vehicle_link.clock import monotonic_ns
from vehicle_link.messages import encode, header, new
from vehicle_link.topics.control_inputs import decode_external_reference

if TYPE_CHECKING:
    from quadlab.station_client import StationClient

PERIOD = 0.02
"""Seconds between two references."""
TIMEOUT_NS = 500_000_000
"""Age (ns) at which a set-point is too old to be flown."""
LEAD, TRIES = 0.1, 6
"""Seconds of references before the vehicle is asked to fly them, and how often: the first ones may
arrive after the question."""
STARTING_NS = 1_500_000_000
"""Time (ns) in which the vehicle's status must show that the behavior has begun."""
APPROACH = 1.2
"""Speed towards a position set-point, in m/s for each m of way left."""
INSET = 0.02
"""Distance, in m, from the walls at which the reference ends."""
SHARE = 0.8
"""Share of the vehicle's limits that is used, because it also checks where a reference leads."""
SECOND = 1e-9
POSITION, VELOCITY, YAW, YAW_RATE = 0b111, 0b111 << 3, 1 << 10, 1 << 11
"""Bits of a type mask: set, the numbers are to be ignored."""
BODY_FRAMES = (mavlink.MAV_FRAME_BODY_NED, mavlink.MAV_FRAME_BODY_OFFSET_NED)


class Sender(Protocol):
    """A publisher of references."""

    def put(self, payload: bytes, source_ns: int | None = None) -> None: ...


@dataclass(frozen=True, slots=True)
class SetPoint:
    """The set-point of a ground station; None where it sets nothing.

    Attributes:
        velocity: world axes, or with `is_body` forward, left, up.
        came_ns: flight's steady clock.
    """

    position_w: Vector | None
    velocity: Vector | None
    is_body: bool
    yaw: float | None
    yaw_rate: float
    came_ns: int


def set_point_of(message: MAVLink_message, origin: Origin, now_ns: int) -> SetPoint:
    """Return a SET_POSITION_TARGET_LOCAL_NED or …_GLOBAL_INT. Raises RefusedError with what is not
    possible.
    """
    mask, frame = message.type_mask, message.coordinate_frame
    is_global = message.get_type() == "SET_POSITION_TARGET_GLOBAL_INT"
    is_body = not is_global and frame in BODY_FRAMES
    if not (is_global or is_body or frame == mavlink.MAV_FRAME_LOCAL_NED):
        raise RefusedError(f"set-points in frame {frame} are not flown; send LOCAL_NED or BODY_NED")
    position = velocity = None
    if mask & POSITION != POSITION:
        if mask & POSITION or is_body:
            raise RefusedError("a position set-point needs all of x, y, z, in LOCAL_NED or global")
        if is_global:
            place = 1e-7 * message.lat_int, 1e-7 * message.lon_int, message.alt
            position = world_point(frame, *place, origin)
        else:
            position = swap_world((message.x, message.y, message.z))
    if mask & VELOCITY != VELOCITY:
        if mask & VELOCITY:
            raise RefusedError("a velocity set-point needs all of vx, vy, vz")
        sent = (message.vx, message.vy, message.vz)
        velocity = (sent[0], -sent[1], -sent[2]) if is_body else swap_world(sent)
    if position is None and velocity is None:
        raise RefusedError("only set-points of position, velocity or both are flown")
    yaw = None if mask & YAW or is_body else swap_yaw(message.yaw)
    rate = 0.0 if mask & YAW_RATE else -message.yaw_rate
    numbers = (*(position or ()), *(velocity or ()), rate, yaw or 0.0)
    if not all(map(math.isfinite, numbers)):
        raise RefusedError("a set-point with a number that is not finite")
    return SetPoint(position, velocity, is_body, yaw, rate, now_ns)


class Follower:
    """A reference that follows set-points.

    Args:
        reference: where it begins, REFERENCE (1,).
        parameters: the vehicle's `behavior.*`.
    """

    def __init__(self, reference: Record, parameters: Mapping[str, Any]) -> None:
        p = section_of(BehaviorParameters, "behavior.", parameters)
        self.reference = reference.copy()
        self._filter = new_velocity_filter(
            reference, SHARE * p.acceleration_max, SHARE * p.yaw_acceleration_max
        )
        set_walls(self._filter, p, INSET)
        self._speed = p.fly_to_speed
        self._speed_max = SHARE * p.trajectory_speed_max
        self._yaw_rate_max = SHARE * p.yaw_rate_max

    def step(self, wanted: SetPoint, dt: float) -> None:
        """Advance the reference by dt (s)."""
        r, command = self.reference[0], self._filter["command"][0]
        while dt > 0.0:
            yaw = float(r["yaw"])
            velocity = self._velocity(wanted, r)
            if not wanted.is_body:  # the filter takes forward, left, up
                c, s = math.cos(yaw), math.sin(yaw)
                x, y, z = velocity
                velocity = c * x + s * y, c * y - s * x, z
            rate = wanted.yaw_rate
            if wanted.yaw is not None:
                rate += 2.0 * APPROACH * math.remainder(wanted.yaw - yaw, 2.0 * math.pi)
            command[:3] = velocity
            command[3] = max(-self._yaw_rate_max, min(self._yaw_rate_max, rate))
            advance(self._filter, min(dt, PERIOD), self.reference)
            dt -= PERIOD

    def _velocity(self, wanted: SetPoint, r: Any) -> Vector:
        x, y, z = wanted.velocity or (0.0, 0.0, 0.0)
        if wanted.position_w is not None:
            way = [
                goal - float(at)
                for goal, at in zip(wanted.position_w, r["position_w"], strict=True)
            ]
            length = math.hypot(*way)
            share = min(APPROACH, self._speed / length) if length > 0.0 else 0.0
            x, y, z = (v + share * w for v, w in zip((x, y, z), way, strict=True))
        fast = math.hypot(x, y, z)
        slower = min(1.0, self._speed_max / fast) if fast > 0.0 else 1.0
        return slower * x, slower * y, slower * z


class Offboard:
    """Sends references while a ground station has offboard flight.

    Args:
        say: called with (whose flight it was, line) when one has ended; from a thread.
    """

    def __init__(self, vehicle: Vehicle, sender: Sender, say: Callable[[str, str], None]) -> None:
        self._vehicle, self._sender, self._say = vehicle, sender, say
        self._set_points: dict[str, SetPoint] = {}
        self._offsets: deque[int] = deque(maxlen=50)
        self._running: threading.Thread | None = None
        self._stop = threading.Event()
        self._who, self._accepted_ns = "", 0
        # Compiled now: the first call in flight would be late.
        advance(new_velocity_filter(new_reference(), 1.0, 1.0), 0.0, new_reference())
        extrapolate(new_reference(), 0.0, new_reference())

    def take(self, who: str, wanted: SetPoint) -> None:
        """Take a set-point of a ground station."""
        self._set_points[who] = wanted

    def begin(self, who: str, parameters: Mapping[str, Any]) -> None:
        """Send references that repeat the vehicle's own, until `accepted` or `end`. Raises
        RefusedError.
        """
        wanted = self._set_points.get(who)
        if wanted is None or monotonic_ns() - wanted.came_ns > TIMEOUT_NS:
            raise RefusedError("offboard needs set-points: send them first, 2 a second or more")
        if self._vehicle.payload("reference") is None:
            raise RefusedError("the vehicle's reference is not known; check the link")
        if self._running is not None and self._running.is_alive() and self._who != who:
            raise RefusedError(f"{self._who} flies offboard already")
        self.end()
        self._who = who
        self._stop, self._accepted_ns = threading.Event(), 0
        self._running = threading.Thread(
            target=self._run, args=(who, dict(parameters), self._stop), name="offboard", daemon=True
        )
        self._running.start()

    def ask(self, client: StationClient) -> None:
        """Ask the vehicle to fly the references; waits. Raises RefusedError, LinkError."""
        for k in range(TRIES):
            self._stop.wait(LEAD)
            try:
                client.ask("start_behavior", name="external", arguments=[])
                return
            except RefusedError as error:
                if k == TRIES - 1 or error.kind != Refusal.NO_REFERENCE:
                    raise

    def accepted(self) -> None:
        """Follow the set-points from now on: the vehicle flies the motion that is sent."""
        self._accepted_ns = monotonic_ns()

    def left(self, who: str) -> None:
        """Forget a ground station that has left."""
        self._set_points.pop(who, None)

    def end(self) -> None:
        """Send no more references."""
        self._stop.set()
        if self._running is not None and self._running is not threading.current_thread():
            self._running.join(1.0)

    def _run(self, who: str, parameters: Mapping[str, object], stop: threading.Event) -> None:
        follower, last_ns, has_begun = None, 0, False
        while not stop.wait(PERIOD):
            now_ns = monotonic_ns()
            stamp_ns = self._vehicle_ns(now_ns)
            wanted = self._set_points.get(who)
            if wanted is None or now_ns - wanted.came_ns > TIMEOUT_NS:
                self._say(who, "offboard has ended: no set-points came; the vehicle brakes")
                return
            if not self._accepted_ns:
                self._send(self._vehicles(stamp_ns), stamp_ns)
                continue
            has_begun = has_begun or self._vehicle.behavior == "external"
            is_late = now_ns - self._accepted_ns > STARTING_NS
            if self._vehicle.behavior != "external" and (has_begun or is_late):
                self._say(who, f"offboard has ended: {self._vehicle.behavior or 'not heard'}")
                return
            if follower is None:
                follower, last_ns = Follower(self._vehicles(stamp_ns), parameters), now_ns
            follower.step(wanted, (now_ns - last_ns) * SECOND)
            last_ns = now_ns
            self._send(follower.reference, stamp_ns)

    def _vehicle_ns(self, now_ns: int) -> int:
        """Return the vehicle's clock: the smallest delay of recent messages counts."""
        newest = self._vehicle.payload("reference")
        if newest is not None:
            self._offsets.append(newest[1] - decode_external_reference(newest[0])[0])
        return now_ns - min(self._offsets, default=0)

    def _vehicles(self, stamp_ns: int) -> Record:
        """Return the vehicle's own reference, extrapolated to `stamp_ns`."""
        newest, out = self._vehicle.payload("reference"), new_reference()
        if newest is not None:
            heard_ns, reference = decode_external_reference(newest[0])
            extrapolate(reference, (stamp_ns - heard_ns) * SECOND, out)
        return out

    def _send(self, reference: Record, stamp_ns: int) -> None:
        r = reference[0]
        vectors = {
            name: dict(zip("xyz", map(float, r[f"{name}_w"]), strict=True))
            for name in ("position", "velocity", "acceleration", "jerk", "snap")
        }
        yaw = {name: float(r[name]) for name in ("yaw", "yaw_rate", "yaw_acceleration")}
        message = new("quadlab_msgs/Reference", header=header(stamp_ns, "world"), **vectors, **yaw)
        self._sender.put(encode(message), stamp_ns)
