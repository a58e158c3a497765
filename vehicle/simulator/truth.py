"""Publish the truth like a tracking system, and the force/torque sensor's readings.

The network may be slow or the station disconnected, and the plant must not wait: a separate thread
publishes, with only the newest few states in its queue.
"""

from __future__ import annotations

import contextlib
import os
import queue
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from quadrotor.errors import LinkError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle.simulator.attendant import Attendant
from vehicle.simulator.force_sensor import ForceReading
from vehicle.simulator.live_parameters import LiveParameters, ReportingParameters
from vehicle_link import clock
from vehicle_link.transport.loopback import SharedSession

if TYPE_CHECKING:
    from vehicle_link.topics.table import Topic

KEPT = 8
PRIORITY = 10
"""SCHED_FIFO priority, below the plant's."""
RETRY_S = 1.0
PUBLISHED = ("truth", "bench_reading")


class Put(Protocol):
    """Function that sends one payload with its source time in ns."""

    def __call__(self, payload: bytes, source_ns: int, topic: str = "truth", /) -> None: ...


class TruthPublisher:
    """Publisher of STATE records and readings.

    Args:
        connect: opens the connection and returns functions to send and to close; it may block or
            raise LinkError, and is retried each second.
        vehicle: name, for the frame ids.
    """

    def __init__(self, connect: Callable[[], tuple[Put, Callable[[], None]]], vehicle: str) -> None:
        self.dropped = 0
        self._connect = connect
        self._vehicle = vehicle
        self._states: queue.Queue[tuple[int, Record | ForceReading] | None] = queue.Queue(KEPT)
        self._stop = threading.Event()
        self._complained = False
        # A daemon: opening a session can block for as long as the station is unreachable.
        self._thread = threading.Thread(target=self._run, name="truth", daemon=True)
        self._thread.start()

    def offer(self, stamp_ns: int, state: Record) -> None:
        """Send this state (1,), which is copied; dropped when the thread is behind."""
        self._offer(stamp_ns, state.copy())

    def offer_reading(self, stamp_ns: int, reading: ForceReading) -> None:
        """Send a reading of the force/torque sensor, as `offer` does for a state."""
        self._offer(stamp_ns, reading)

    def _offer(self, stamp_ns: int, what: Record | ForceReading) -> None:
        try:
            self._states.put_nowait((stamp_ns, what))
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Stop sending; waits for the session to close, at most 2 s."""
        self._stop.set()
        with contextlib.suppress(queue.Full):  # full: the thread is awake and checks for the stop
            self._states.put_nowait(None)
        self._thread.join(2.0)

    def _run(self) -> None:
        set_real_time(True)
        # Imported here: the message types take a while to load, which the plant need not wait for.
        from vehicle_link.topics.bench_readings import encode_bench_reading
        from vehicle_link.topics.ticks import odometry_messages

        while not self._stop.is_set():
            set_real_time(False)  # the network's threads start now, at normal priority
            try:
                put, close = self._connect()
            except LinkError as error:
                self._complain(error)
                self._stop.wait(RETRY_S)
                continue
            set_real_time(True)
            with contextlib.suppress(queue.Empty):  # drop states from before the session
                while True:
                    self._states.get_nowait()
            try:
                while not self._stop.is_set():
                    item = self._states.get()
                    if item is None:
                        continue
                    stamp_ns, what = item
                    if isinstance(what, ForceReading):
                        payload = encode_bench_reading(
                            stamp_ns, what.force, what.torque, what.speed
                        )
                        put(payload, stamp_ns, "bench_reading")
                    else:
                        put(odometry_messages(stamp_ns, what, self._vehicle).tobytes(), stamp_ns)
            except LinkError as error:
                self._complain(error)
            finally:
                close()

    def _complain(self, error: LinkError) -> None:
        if not self._complained:
            self._complained = True
            print(f"simulator: truth is not published yet: {error}", file=sys.stderr, flush=True)


def set_real_time(on: bool) -> None:
    """Give this thread a real-time priority or remove it, as far as permitted.

    It shares the interpreter lock with the plant: preempted while it holds the lock, it would stop
    the plant, whatever the plant's own priority.
    """
    policy, priority = (os.SCHED_FIFO, PRIORITY) if on else (os.SCHED_OTHER, 0)
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, policy, os.sched_param(priority))


def _sure(topic: Topic) -> Topic:
    """Return the topic, reliable in lockstep, where the next truth may wait for this one."""
    from vehicle_link.topics.rmw_keys import RELIABLE

    return topic if clock.page() is None else replace(topic, qos=RELIABLE)


def _change_publisher(
    put: Callable[[bytes, int], object],
) -> Callable[[str, ParameterValue, ParameterValue, str, int], None]:
    """Return the function that publishes a change of a parameter: its name, old and new value,
    requester and revision.
    """
    from vehicle_link.parameters.change import ParameterChange
    from vehicle_link.parameters.messages import encode_change
    from vehicle_link.process_instance import new_instance

    instance = new_instance()

    def publish_change(
        name: str, old: ParameterValue, value: ParameterValue, requester: str, revision: int
    ) -> None:
        stamp_ns = clock.time_ns()
        change = ParameterChange(
            stamp_ns,
            name,
            old=old,
            new=value,
            requester=requester,
            revision=revision,
            instance=instance,
        )
        put(encode_change(change), stamp_ns)

    return publish_change


def connect_to_station(
    shared: SharedSession, vehicle: str, live: LiveParameters, attendant: Attendant
) -> Callable[[], tuple[Put, Callable[[], None]]]:
    """Return `connect` of a TruthPublisher: its topics of /<vehicle> through the station's router.

    The simulator's parameters are served in the same way below /<vehicle>/simulator, and manual
    actions at the vehicle as /<vehicle>/simulator/simulation.
    """

    def connect() -> tuple[Put, Callable[[], None]]:
        from vehicle_link.messages import Message, new
        from vehicle_link.messages.records import ChangeParametersRequest, SimulationRequest
        from vehicle_link.parameters.messages import from_parameters, to_parameters
        from vehicle_link.topics.table import SERVICES, TOPICS
        from vehicle_link.transport.idempotent import Idempotent
        from vehicle_link.transport.node import Node
        from vehicle_link.transport.parameter_service import serve_parameters

        node = Node(shared.open(), f"/{vehicle}", "simulator")
        publishers = {topic: node.advertise(_sure(TOPICS[topic])) for topic in PUBLISHED}
        changes = node.advertise(TOPICS["parameter_changes"])

        def change(request: ChangeParametersRequest) -> Message:
            values = from_parameters(request.parameters)
            applied, revision = served.change(values, request.requester)
            return new(
                f"{service}_Response",
                accepted=True,
                applied=to_parameters(applied),
                revision=revision,
            )

        def attend(request: SimulationRequest) -> Message:
            attendant.ask(str(request.action))
            return new(f"{SERVICES['simulation']}_Response", accepted=True)

        served = ReportingParameters(live, _change_publisher(changes.put))
        serve_parameters(node, served)
        service = SERVICES["change_parameters"]
        node.serve("simulator/change_parameters", service, change)
        node.serve("simulator/simulation", SERVICES["simulation"], Idempotent(attend))

        def close() -> None:
            node.close()
            shared.close()

        def put(payload: bytes, source_ns: int, topic: str = "truth", /) -> None:
            publishers[topic].put(payload, source_ns)

        return put, close

    return connect
