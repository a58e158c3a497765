"""Landing of flying vehicles before all processes are stopped."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

from quadrotor.errors import LinkError, RefusedError
from vehicle_link import clock
from vehicle_link.termination_signal import EndSignal

if TYPE_CHECKING:
    from vehicle_link.messages.records import VehicleStatus
    from vehicle_link.transport.loopback import Session
    from vehicle_link.transport.publisher import Received
LANDING_PATIENCE = 40.0
HEARING = 1.5
"""Seconds to wait for the vehicles' statuses."""
ASK_AGAIN = 1.0
"""Seconds until a vehicle that does not yet do as asked is asked again."""
LANDING = ("land", "emergency_landing")
"""Behaviors that end on the ground."""
NEEDED = 32
"""File descriptors kept for the session over which vehicles are landed, which opens 8."""


def reserved_descriptors() -> ExitStack:
    """Take the file descriptors that the landing needs; closing the result gives them back."""
    reserve = ExitStack()
    for _ in range(NEEDED):
        reserve.callback(os.close, os.open(os.devnull, os.O_RDONLY))
    return reserve


class _Landing:
    """The end of one vehicle's flight; `session` is connected to the station.

    In the air the vehicle is asked to land, on the ground to disarm, again and again until its
    motors are off: a request may be refused or lost, and somebody may have started another behavior
    since.
    """

    def __init__(self, session: Session, name: str, shown: str) -> None:
        from vehicle_link.transport.node import Node

        self.was_received = threading.Event()
        self.on_ground = threading.Event()
        self._shown = shown
        self._status: VehicleStatus | None = None
        self._closing = threading.Event()
        self.asking = threading.Thread(target=self._ask_on, daemon=True)
        self._said = ""
        self._node = Node(session, f"/{name}", "stopping")
        self._node.subscribe("status", "quadlab_msgs/VehicleStatus", self._on_status)

    def _ask_on(self) -> None:
        while not (self.on_ground.is_set() or self._closing.is_set()):
            self._ask()
            self.on_ground.wait(ASK_AGAIN)

    def _ask(self) -> None:
        """Ask for the next step towards motors off; a refusal is told once."""
        from vehicle_link.topics.table import SERVICES

        status = self._status
        if (
            status is None
            or status.mode != "armed"
            or (status.airborne and status.behavior in LANDING)
        ):
            return  # it lands already
        name = "start_behavior" if status.airborne else "disarm"
        client = self._node.client(f"station/{name}", SERVICES[name])
        try:
            if status.airborne:
                client.ask("quadlab up", name="land")
            else:
                client.ask("quadlab up")
        except (LinkError, RefusedError) as error:
            if str(error) != self._said and not self._closing.is_set():
                self._said = str(error)
                self.say(self._said)

    def close(self) -> None:
        self._closing.set()
        self._node.close()

    def _on_status(self, received: Received) -> None:
        from vehicle_link.messages import decode

        status = decode(received.payload, "quadlab_msgs/VehicleStatus")
        self._status = status
        lands = status.armed and status.mode != "bench"  # the bench ends with the vehicle process
        (self.on_ground.clear if lands else self.on_ground.set)()
        self.was_received.set()

    def say(self, line: str) -> None:
        print(f"quadlab: {self._shown}{line}", flush=True)


def land_before_stopping(loopback_port: int, names: Sequence[str], stop: EndSignal) -> None:
    """Land all through the station and wait for motors off; give up when asked twice or late."""
    from vehicle_link.transport.loopback import loopback_session

    try:
        session = loopback_session(loopback_port)
    except LinkError as error:
        print(f"quadlab: not landed, the station does not answer ({error})", flush=True)
        return
    landings = [_Landing(session, name, f"{name}: " if len(names) > 1 else "") for name in names]
    try:
        until = time.monotonic() + HEARING
        for landing in landings:
            landing.was_received.wait(max(0.0, until - time.monotonic()))
        heard = [landing for landing in landings if landing.was_received.is_set()]
        due = [landing for landing in heard if not landing.on_ground.is_set()]
        if not due:
            return
        print("quadlab: landing before stopping; Ctrl-C again stops at once", flush=True)
        for landing in due:
            landing.asking.start()
        until = clock.monotonic() + LANDING_PATIENCE
        while clock.monotonic() < until:
            if stop.count > 1 or all(landing.on_ground.is_set() for landing in due):
                return
            time.sleep(0.1)
        for landing in due:
            if not landing.on_ground.is_set():
                landing.say(f"not on the ground after {LANDING_PATIENCE:.0f} s; stopping")
    finally:
        for landing in landings:
            landing.close()
        session.close()
