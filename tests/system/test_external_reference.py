"""A program on the base station flies the laboratory's vehicle by references.

It does so as a ROS 2 node would: over the station's session and the radio.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import closing
from typing import Any

import pytest

from flight_log import is_closed, read_log
from vehicle_link.messages import decode, encode, header, new
from vehicle_link.topics.control_inputs import decode_external_reference
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

pytestmark = pytest.mark.timeout(180)
SPEED, WAY = 0.3, 0.6  # m/s, m
PERIOD = 0.02


class Program:
    """Sends 50 references a second: rests at the vehicle's position, then flies WAY along x."""

    def __init__(self, session: Any) -> None:
        self.node = Node(session, "/quad1", "planner")
        self._publisher = self.node.advertise(TOPICS["external_reference"])
        row = TOPICS["reference"]
        self.node.subscribe(row.name, row.type_name, self._heard, qos=row.qos, direct=True)
        self._newest: tuple[int, int, Any] | None = None  # stamp, ns of this computer, reference
        self._begin: Any = None
        self.going, self._silent = threading.Event(), threading.Event()
        self._began_ns = 0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _heard(self, received: Received) -> None:
        stamp_ns, reference = decode_external_reference(received.payload)
        self._newest = stamp_ns, time.monotonic_ns(), reference

    @property
    def flown(self) -> float:
        """Return the distance along x, in m, of the reference that the vehicle publishes."""
        if self._newest is None or self._begin is None:
            return 0.0
        return float((self._newest[2]["position_w"] - self._begin["position_w"])[0, 0])

    def _run(self) -> None:
        while not self._silent.wait(PERIOD):
            newest = self._newest
            if newest is None:
                continue
            stamp_ns = newest[0] + time.monotonic_ns() - newest[1]
            if self._begin is None:
                self._begin = newest[2].copy()
            if self.going.is_set():
                self._began_ns = self._began_ns or stamp_ns
            gone = SPEED * (stamp_ns - self._began_ns) * 1e-9 if self._began_ns else 0.0
            x, y, z = self._begin["position_w"][0].tolist()
            told = {
                "position": {"x": x + min(gone, WAY), "y": y, "z": z},
                "velocity": {"x": SPEED if 0.0 < gone < WAY else 0.0, "y": 0.0, "z": 0.0},
                "yaw": float(self._begin["yaw"][0]),
            }
            message = new("quadlab_msgs/Reference", header=header(stamp_ns, "world"), **told)
            self._publisher.put(encode(message), stamp_ns)

    def fall_silent(self) -> None:
        self._silent.set()
        self._thread.join(10.0)

    def close(self) -> None:
        self.fall_silent()
        self.node.close()


def test_a_program_flies_the_vehicle_and_its_silence_ends_in_hover(
    lab: Any, until: Callable[..., Any]
) -> None:
    lab.hover()
    # A host that stalls for a moment must not end the test.
    patient = {"values": {"behavior.external_timeout": 1.0}}
    assert lab.browser.put("/api/parameters", json=patient).status_code == 200
    refused = lab.command("start_behavior", name="external", arguments={})
    assert refused.status_code == 409
    assert (
        "no reference was received on the topic external_reference; start publishing first"
        in refused.text
    )
    session = loopback_session(lab.link_port)
    with closing(session), closing(Program(session)) as program:
        until(
            "the first references",
            lambda: lab.command("start_behavior", name="external", arguments={}).status_code == 200,
            20,
        )
        lab.reach(behavior="external")
        program.going.set()
        until("the way to be flown", lambda: abs(program.flown - WAY) < 1e-6)
        assert lab.status()["behavior"] == "external"
        program.fall_silent()
        lab.reach(behavior="hover")
        assert abs(program.flown - WAY) < 1e-6
    lab.start("land")
    lab.reach(mode="ready", armed=False)
    log = lab.newest("onboard")
    until("the vehicle's log to be closed", lambda: is_closed(log))
    assert len(list(read_log(log, topics=["/quad1/external_reference"]))) > 50
    events = read_log(log, topics=["/quad1/events"])
    told = [decode(event.payload, "rcl_interfaces/Log").msg for event in events]
    assert any("braking: the newest reference" in line for line in told), told
