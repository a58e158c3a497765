"""Forward messages of the station to the flight process's inbox: poses, bearings, sticks,
references and heartbeats.

All stamps are already of the vehicle's clock. Messages older than 200 ms, or stamped as far in the
future, are ignored; either is reported at most once in five seconds.

One station holds the vehicle: the first whose heartbeats arrive, until they fail for 1 s. Those of
another are ignored, and it sends nothing else while our heartbeats name the holder. Each topic also
has one source, whoever publishes it: two tracking systems are never mixed. Held sticks that fall
silent are reported.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

from bearing_sim.beacon_set import KnownBeacons
from bearing_sim.beacons import PAPER_BEACONS, parse_layout
from estimation.outcome import LATEST_NS
from estimation.poses.planar_pose import PlanarPoseSolver
from quadrotor.errors import LinkError, MeasurementError
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.comms.bearing_pose import bearing_pose
from vehicle.comms.commands import FlightMailbox
from vehicle.comms.held_sticks import AGAIN, HeldSticks
from vehicle.comms.vehicle_clock import VehicleClock
from vehicle_link.clock import monotonic_ns
from vehicle_link.process_instance import short_id
from vehicle_link.topics.control_inputs import (
    decode_external_reference,
    decode_heartbeat,
    decode_joy,
)
from vehicle_link.topics.measurements import decode_bearings, decode_pose, decode_position
from vehicle_link.topics.table import TOPICS

Key = TypeVar("Key")
SILENT_NS = 1_000_000_000


class PreferredSource(Generic[Key]):
    """Selector of the first source received; times in ns of any steady clock. Not thread-safe."""

    def __init__(self, silent_ns: int = SILENT_NS) -> None:
        self._silent_ns = silent_ns
        self._key: Key | None = None
        self._received_ns = 0
        self._has_refused = False
        self.is_contested = False
        """True if the source was received again after another one was refused: there are two, and
        none was only started anew."""

    def accepts(self, key: Key, now_ns: int) -> bool:
        """Return whether to accept this source; it is selected when there is no other."""
        if self.current(now_ns) not in (None, key):
            self._has_refused = True
            return False
        self.is_contested = self._has_refused = self._has_refused and key == self._key
        self._key, self._received_ns = key, now_ns
        return True

    def current(self, now_ns: int) -> Key | None:
        """Return the selected source; None when it has been silent for too long."""
        return self._key if now_ns - self._received_ns < self._silent_ns else None


OLDEST_NS = 200_000_000
WARN_EVERY_NS = 5_000_000_000

STATION_LOST_S = 1.0
Say = Callable[[int, str], None]


class RateLimitedWarnings:
    """Rate limiter of warnings: one per five seconds and subject, with a count of the others."""

    def __init__(self, say: Say, clock: VehicleClock) -> None:
        self._say = say
        self._clock = clock
        self._lock = threading.Lock()
        self._warned_ns: dict[str, int] = {}
        self._held_back: dict[str, int] = {}

    def __call__(self, subject: str, text: str) -> None:
        now_ns = self._clock.now_ns()
        with self._lock:
            if 0 <= now_ns - self._warned_ns.get(subject, -WARN_EVERY_NS) < WARN_EVERY_NS:
                self._held_back[subject] = self._held_back.get(subject, 0) + 1
                return
            self._warned_ns[subject] = now_ns
            more = self._held_back.pop(subject, 0)
        self._say(mailbox.WARN, f"{subject}: {text}" + (f" (and {more} more)" if more else ""))


class Inbound:
    """Callbacks of the subscriptions; each may run in its own thread.

    Args:
        bearing_pose: called with (payload, stamp in ns) of a one-frame pose.
        log: called with (topic, payload, stamp in ns) of every message that was not ignored.
        resumes: whether a comms process before this one has died: it had a station.

    """

    def __init__(
        self,
        flight: FlightMailbox,
        clock: VehicleClock,
        say: Say,
        bearing_pose: Callable[[bytes, int], None],
        log: Callable[[str, bytes, int], None],
        *,
        resumes: bool = False,
    ) -> None:
        self._flight = flight
        self._clock = clock
        self._warn = RateLimitedWarnings(say, clock)
        self._bearing_pose = bearing_pose
        self._log = log
        self._solves = False
        self._layout, self._beacons = "paper", KnownBeacons(PAPER_BEACONS)
        self._preparing: threading.Thread | None = None
        self._received_ns: int | None = 0 if resumes else None
        self._say = say
        self._station = PreferredSource[int]()
        self._sticks = HeldSticks()
        self._sources = {
            name: PreferredSource[bytes]() for name, row in TOPICS.items() if row.one_source
        }
        self._newest_state: Record | None = None
        self.handlers: dict[str, Callable[[bytes], None]] = {
            "tracker_pose": partial(self._tracked, "tracker_pose", decode_pose),
            "tracker_position": partial(self._tracked, "tracker_position", decode_position),
            "bearings": self._bearings,
            "joy": self._joy,
            "external_reference": self._external_reference,
            "station_heartbeat": self._heartbeat,
        }

    def note_state(self, state: Record) -> None:
        """Note the STATE of the newest tick, shape (1,), from which the search for a one-frame pose
        starts.
        """
        self._newest_state = state
        self.prepare()

    def prepare(self) -> threading.Thread:
        """Prepare the solver of one-frame poses in a thread, as it may have to compile.

        Called once ticks arrive: until then flight's own compiling needs the processor. Bearings
        that arrive before it is ready give no pose.
        """
        if self._preparing is None:
            self._preparing = threading.Thread(target=self._make_solver, daemon=True)
            self._preparing.start()
        return self._preparing

    def _make_solver(self) -> None:
        PlanarPoseSolver(PAPER_BEACONS.positions_w)
        self._solves = True

    def set_layout(self, text: str) -> None:
        """Set the beacons' positions from the text of the parameter beacons.layout.

        Raises MeasurementError.
        """
        if text != self._layout:
            self._layout, self._beacons = text, KnownBeacons(parse_layout(text))

    @property
    def station_silence(self) -> float:
        """Return the seconds since the station's last heartbeat; inf before the first."""
        received_ns = self._received_ns
        return math.inf if received_ns is None else (monotonic_ns() - received_ns) * 1e-9

    @property
    def is_lost(self) -> bool:
        """Return whether the station has not been heard for STATION_LOST_S."""
        return self.station_silence > STATION_LOST_S

    @property
    def holder(self) -> int:
        """Return the instance of the station that holds the vehicle; 0 when none is connected."""
        return self._station.current(monotonic_ns()) or 0

    def handle(self, topic: str, payload: bytes, source: bytes = b"") -> None:
        """Handle one message of a topic of `handlers`; unusable messages are reported.

        Args:
            source: the publisher's GID; empty when it is known to be the holder's.
        """
        source_of = self._sources.get(topic)
        if source and source_of and not source_of.accepts(source, monotonic_ns()):
            if source_of.is_contested:
                self._warn(
                    topic, "a second sender is ignored; stop one of the two (station, ROS 2 node)"
                )
            return
        try:
            if topic == "joy":
                self._joy(payload, source)
            else:
                self.handlers[topic](payload)
        except (LinkError, MeasurementError) as error:
            self._warn(topic, str(error))

    def _tracked(self, topic: str, decode: Callable[[bytes], Record], payload: bytes) -> None:
        sample = decode(payload)
        stamp_ns = int(sample["stamp_ns"][0])
        if self._fresh(topic, stamp_ns):
            self._send(sample)
            self._log(topic, payload, stamp_ns)

    def report_silence(self) -> None:
        """Report once that held sticks have fallen silent; called often."""
        if self._sticks.fell_silent():
            self._warn("joy", f"silent for 0.5 s while held; {AGAIN}")

    def _joy(self, payload: bytes, sender: bytes = b"") -> None:
        sticks = decode_joy(payload)
        if not self._fresh("joy", sticks.stamp_ns):
            return
        if self._sticks.count(sender, sticks):
            self._send(mailbox.Joy(sticks.stamp_ns, sticks.axes, sticks.enabled))
            self._log("joy", payload, sticks.stamp_ns)
        else:
            self._warn(
                "joy", f"ignored after a silence, or from another sender than before; {AGAIN}"
            )

    def _external_reference(self, payload: bytes) -> None:
        stamp_ns, reference = decode_external_reference(payload)
        if self._fresh("external_reference", stamp_ns):
            numbers = tuple(reference.view("f8").tolist())
            self._send(mailbox.ExternalReference(stamp_ns, numbers))
            self._log("external_reference", payload, stamp_ns)

    def _heartbeat(self, payload: bytes) -> None:
        instance = decode_heartbeat(payload).instance
        now_ns = monotonic_ns()
        before = self._station.current(now_ns)
        if not self._station.accepts(instance, now_ns):
            if self._station.is_contested:
                self._warn(
                    "station_heartbeat",
                    f"station {short_id(instance)} is ignored: station {short_id(before or 0)} "
                    "controls this vehicle; stop one of the two",
                )
            return
        if before is None:
            self._say(mailbox.INFO, "base station connected")
        self._received_ns = now_ns
        # The station's own stamp may precede its time synchronisation, so the time of arrival
        # counts.
        self._send(mailbox.Heartbeat(self._clock.now_ns()))

    def _bearings(self, payload: bytes) -> None:
        seen = decode_bearings(payload)
        stamp_ns = int(seen["stamp_ns"][0])
        if not self._fresh("bearings", stamp_ns, LATEST_NS):
            return
        self._send(seen)
        self._log("bearings", payload, stamp_ns)
        if self._solves:
            self._bearing_pose(bearing_pose(seen, self._beacons, self._newest_state), stamp_ns)

    def _fresh(self, topic: str, stamp_ns: int, oldest_ns: int = OLDEST_NS) -> bool:
        age_ns = self._clock.now_ns() - stamp_ns
        allowed_ns = oldest_ns if age_ns > 0 else OLDEST_NS
        if abs(age_ns) <= allowed_ns:
            return True
        when = f"{age_ns / 1e6:.0f} ms old" if age_ns > 0 else f"{-age_ns / 1e6:.0f} ms ahead"
        self._warn(
            topic,
            f"ignored, its stamp is {when} of the vehicle's clock; "
            f"allowed {allowed_ns / 1e6:.0f} ms",
        )
        return False

    def _send(self, message: mailbox.Measurement | Record) -> None:
        if not self._clock.started:
            return  # flight is still starting: its inbox is not read yet
        if not self._flight.send(message):
            self._warn("flight inbox", "full; measurements are lost")
