"""Serve the simulator's truth as measured by the simulated tracker, in a separate thread.

The plant never waits: it puts its truth in a queue, and a full queue drops it.
"""

from __future__ import annotations

import contextlib
import queue
import random
import sys
import threading
from collections.abc import Mapping, Sequence

from bearing_sim.pose_measurement import PoseMeasurement
from bearing_sim.tracker import SimulatedTracker, TrackerParameters
from quadrotor.errors import UsageError
from quadrotor.extension import ServedSystem
from quadrotor.extensions import Offered, registry
from quadrotor.plain_rotations import Array
from vehicle.simulator.tracking_systems.faults import TrackingFaults
from vehicle.simulator.tracking_systems.frame import Server, in_system

KEPT = 64
POLL = 0.01
"""Time, in s, between two checks for requests of clients."""


def known_systems() -> dict[str, Offered[ServedSystem]]:
    """Return the systems that can be served, by name."""
    return registry().offers(ServedSystem)


def parse_systems(words: Sequence[str]) -> dict[str, int]:
    """Return `system` or `system=port` words as {system: port}. Raises UsageError."""
    found: dict[str, int] = {}
    known = known_systems()
    for word in words:
        system, equals, port = word.partition("=")
        if system not in known or system in found:
            raise UsageError(
                f"--serve {word} names no system, or one twice; there are {', '.join(known)}"
            )
        found[system] = known[system].offer.port
        if equals:
            if not (port.isdecimal() and 1 <= int(port) < 65535):
                raise UsageError(f"--serve {word} has no port; allowed are 1 to 65534")
            found[system] = int(port)
    return found


class ServedSystems:
    """Servers of the vehicles' bodies, by the vehicles' names.

    Args:
        systems: port of each.
        tracker: how the poses are measured; each vehicle has its own noise.
        faults: initial faults.

    Raises UsageError when a port cannot be used.
    """

    def __init__(
        self,
        systems: Mapping[str, int],
        vehicles: Sequence[str],
        tracker: TrackerParameters,
        faults: TrackingFaults,
    ) -> None:
        self._systems, self._vehicles = systems, list(vehicles)
        self._faults = dict.fromkeys(vehicles, faults)
        self._trackers = {
            name: SimulatedTracker(tracker.model_copy(update={"seed": tracker.seed + number}))
            for number, name in enumerate(vehicles)
        }
        self._chance = random.Random(tracker.seed)
        self._round: dict[str, PoseMeasurement] = {}
        self._servers = self._started()
        self._truth: queue.Queue[tuple[str, int, Array, Array] | None] = queue.Queue(KEPT)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="served", daemon=True)
        self._thread.start()

    def offer(self, vehicle: str, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        """Serve this true pose: (3,) m, (4,) unit; dropped when the thread is behind."""
        with contextlib.suppress(queue.Full):
            self._truth.put_nowait((vehicle, stamp_ns, position_w.copy(), quaternion_wb.copy()))

    def set_faults(self, vehicle: str, faults: TrackingFaults) -> None:
        """Set the faults from now on; those of the whole system are the first vehicle's."""
        self._faults[vehicle] = faults

    def close(self) -> None:
        """Stop all servers."""
        self._stop.set()
        self._thread.join(2.0)
        self._end()

    def _started(self) -> list[Server]:
        found: list[Server] = []
        try:
            for system, port in self._systems.items():
                found.append(known_systems()[system].load()(self._vehicles, port))
        except BaseException:
            for server in found:
                server.close()
            raise
        return found

    def _end(self) -> None:
        for server in self._servers:
            server.close()
        self._servers = []

    def _run(self) -> None:
        from vehicle.simulator.truth import set_real_time

        set_real_time(True)
        while not self._stop.is_set():
            try:
                item = self._truth.get(timeout=POLL)
            except queue.Empty:
                item = None
            faults = self._faults[self._vehicles[0]]
            if faults.stopped:
                self._end()
            elif not self._servers:
                try:
                    self._servers = self._started()
                except UsageError as error:
                    print(f"simulator: {error}", file=sys.stderr, flush=True)
                    self._stop.wait(1.0)
            for server in self._servers:
                server.poll()
            if item is not None:
                self._take(*item)

    def _take(self, name: str, stamp_ns: int, position_w: Array, quaternion_wb: Array) -> None:
        tracker = self._trackers[name]
        tracker.observe(stamp_ns, position_w, quaternion_wb)
        for measured in tracker.due(stamp_ns):
            if name in self._round:  # another one's was lost
                self._send()
            self._round[name] = measured
            if len(self._round) == len(self._vehicles):
                self._send()

    def _send(self) -> None:
        taken, self._round = self._round, {}
        faults = self._faults[self._vehicles[0]]
        if self._chance.random() < faults.dropped:
            return
        stamp_ns = max(one.stamp_ns for one in taken.values()) + round(1e9 * faults.stamps_ahead)
        bodies = [
            in_system(name, one.position_w, one.quaternion_wb, self._faults[name])
            for name, one in taken.items()
        ]
        for server in self._servers:
            server.send(stamp_ns, bodies)
