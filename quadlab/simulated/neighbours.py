"""The other vehicles around a simulated one: downwash, collisions, and what they broadcast."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from console.experiments.together import Neighbour
from quadlab.simulated.downwash import downward_push, jet_speed
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.meeting import MAIL_MAX, Meeting, Quadruple, Row
from quadrotor.rigid_body import STOPPED
from quadrotor.vehicle_model import thrust_of_reference
from vehicle.simulator.air import ROTOR_RADIUS
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

MEETING_NS = 10_000_000
"""Simulated time between two meetings of the vehicles."""
AGAIN_NS = 1_000_000_000
"""Time apart after which two vehicles that touch have collided anew."""


@dataclass(frozen=True, slots=True)
class Collision:
    """Two vehicles whose spheres touched. time: s; distance: m between their centres."""

    other: str
    time: float
    distance: float


class Neighbours:
    """The other vehicles as one vehicle meets them.

    Args:
        meeting: of the vehicles. wait: waits for it. names: of all of them.
        index: of this one, from 0.
        simulated, log: this one's.

    Attributes:
        separations: smallest distance (m) so far from each of the others, by name.
        collisions: so far.
        log: adds a message to this vehicle's log.
        attitude: returns the vehicle's own estimate of its attitude.
        event: called with a line for each collision.
    """

    def __init__(
        self,
        meeting: Meeting,
        wait: Callable[[], None],
        names: Sequence[str],
        index: int,
        simulated: SimulatedVehicle,
        log: FlightLog,
    ) -> None:
        self.names, self.index = tuple(names), index
        self.separations = {name: math.inf for k, name in enumerate(names) if k != index}
        self.collisions: list[Collision] = []
        self.event: Callable[[str], None] = lambda line: None
        self.attitude: Callable[[], Quadruple] = lambda: (1.0, 0.0, 0.0, 0.0)
        self.log = log.message
        self._mail = b""
        self._after_meeting: list[Callable[[int], None]] = []
        self._meeting, self._wait, self._simulated = meeting, wait, simulated
        self._speeds = simulated.rotor_speeds
        self._position_w = simulated.truth["position_w"][0]
        self._velocity_w = simulated.truth["velocity_w"][0]
        self._quaternion_wb = simulated.truth["quaternion_wb"][0]
        self._next_ns, self._push = 0, 0.0
        self._touched_ns: dict[int, int] = {}

    @property
    def seed(self) -> int:
        """Return the seed of this vehicle."""
        return self._simulated.parameters.seed

    def neighbour(self, index: int) -> Neighbour:
        """Return a vehicle, this one too, as it was at the last meeting."""
        row = self._meeting.rows[index]
        return Neighbour(
            row.stamp_ns, row.position_w, row.velocity_w, row.quaternion_wb, row.radius, row.mail
        )

    def broadcast(self, mail: bytes) -> None:
        """Send bytes, which the others get at the next meeting. Raises ValueError."""
        if len(mail) > MAIL_MAX:
            raise ValueError(f"a message of {len(mail)} bytes; allowed are {MAIL_MAX}")
        self._mail = mail

    def at_meetings(self, call: Callable[[int], None]) -> None:
        """Call this after each meeting, with the time in ns."""
        self._after_meeting.append(call)

    def step(self) -> None:
        """Meet the others if it is time."""
        now_ns = self._simulated.stamp_ns
        if now_ns < self._next_ns:
            return
        self._next_ns = now_ns - now_ns % MEETING_NS + MEETING_NS
        self._leave_row(now_ns)
        self._wait()
        self._mail = b""
        self._look(now_ns)
        for call in self._after_meeting:
            call(now_ns)

    def end(self) -> None:
        """Leave the last row: for the others this vehicle stays where it is."""
        self._leave_row(self._simulated.stamp_ns)

    def _leave_row(self, now_ns: int) -> None:
        x, y, z = self._position_w.tolist()
        u, v, w = self._velocity_w.tolist()
        a, b, c, d = self._quaternion_wb.tolist()
        p, speeds = self._simulated.parameters, self._speeds.tolist()
        slope, offset = p.motor_slope, p.motor_offset
        # Not `rotor_thrust`, which is for compiled functions: each process would compile it anew.
        thrust = sum(thrust_of_reference(n, slope, offset) for n in speeds if n > STOPPED)
        motion = (x, y, z), (u, v, w), (a, b, c, d)
        self._meeting.leave_row(self.index, Row(now_ns, *motion, thrust, radius_of(p), self._mail))

    def _look(self, now_ns: int) -> None:
        x, y, z = self._position_w.tolist()
        own_radius, push = radius_of(self._simulated.parameters), 0.0
        for k, row in enumerate(self._meeting.rows):
            if k == self.index:
                continue
            their_x, their_y, their_z = row.position_w
            u, v, below = their_x - x, their_y - y, their_z - z
            beside_squared = u * u + v * v
            distance = math.sqrt(beside_squared + below * below)
            name = self.names[k]
            self.separations[name] = min(self.separations[name], distance)
            if distance < own_radius + row.radius:
                self._touch(k, now_ns, distance)
            if below > 0.0:
                push += downward_push(jet_speed(row.thrust, below, math.sqrt(beside_squared)))
        if push != self._push:
            self._push = push
            self._simulated.blow_on((0.0, 0.0, -push))

    def _touch(self, k: int, now_ns: int, distance: float) -> None:
        before_ns, self._touched_ns[k] = self._touched_ns.get(k, -AGAIN_NS - 1), now_ns
        if now_ns - before_ns <= AGAIN_NS:
            return
        name = self.names[k]
        self.collisions.append(Collision(name, now_ns * 1e-9, distance))
        self.event(f"collision with {name}: {distance:.2f} m from centre to centre")


def radius_of(parameters: SimulatorParameters) -> float:
    """Return the radius (m) of the sphere around a vehicle's rotors."""
    return parameters.arm + ROTOR_RADIUS


def starts(count: int, spacing: float = 2.0) -> list[tuple[float, float]]:
    """Return where vehicles start: on a square grid (m), from the origin in a spiral outwards."""
    found: list[tuple[float, float]] = []
    x, y, step_x, step_y = 0, 0, 1, 0
    length = 1
    while len(found) < count:
        for _ in range(2):
            for _ in range(length):
                found.append((spacing * x, spacing * y))
                x, y = x + step_x, y + step_y
            step_x, step_y = -step_y, step_x
        length += 1
    return found[:count]
