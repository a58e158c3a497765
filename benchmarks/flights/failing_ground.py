"""The ground side of a flight that fails: optional station, the truth, and all commands.

The truth arrives over a router of this process, which no failure affects.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import free_port
from quadrotor.errors import LinkError
from quadrotor.records import POSE_SAMPLE
from vehicle_link import messages
from vehicle_link.parameters.messages import to_parameters
from vehicle_link.security.authority import ensure_certificates
from vehicle_link.topics.control_inputs import encode_heartbeat
from vehicle_link.topics.measurements import pose_messages
from vehicle_link.topics.table import SERVICES, TOPICS
from vehicle_link.topics.ticks import decode_odometry
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received
from vehicle_link.transport.radio import Radio
from vehicle_link.transport.session import hub_session

PATIENCE = 60.0
BEAT_S = 0.05
NAME, REQUESTER = "quad1", "benchmark"


class NotFlownError(Exception):
    """The flight did not reach the failure."""


def until(what: str, look: Callable[[], Any], patience: float = PATIENCE) -> Any:
    """Return the first true result of `look`. Raises NotFlownError after `patience` (s)."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        found = look()
        if found:
            return found
        time.sleep(0.01)
    raise NotFlownError(f"waited {patience:.0f} s for {what} in vain")


class Ground:
    """The part of the laboratory that is not on board, and the truth.

    Attributes:
        stamp, truth: time (s) and STATE (1,) of the newest truth; `watch` is called with each.
        status: the vehicle's newest status.
    """

    def __init__(self, stack: ExitStack, folder: Path, link_port: int, real_station: bool) -> None:
        self.stamp = 0.0
        self.truth: Any = None
        self.status: Any = None
        self.status_at = 0.0
        self.watch: Callable[[float, Any], None] = lambda *_: None
        self.truth_port = free_port()
        files = ensure_certificates(folder / "certificates", ["127.0.0.1"])
        self._asks = "station/" if real_station else ""
        self._closing = threading.Event()
        own = stack.enter_context(hub_session(self.truth_port))
        if real_station:
            self.station_port = free_port()
            bridge = self._bridge(stack)
            threading.Thread(target=bridge, daemon=True).start()
        else:
            radio = Radio(
                f"127.0.0.1:{link_port}", files, self.truth_port, session_silence=lambda: 0.0
            )
            stack.callback(radio.close, 1.0)
        stack.callback(self._closing.set)
        self._node: Node | None = None if real_station else Node(own, f"/{NAME}", "ground")
        self._truth_node = self._node or Node(own, f"/{NAME}", "truth")
        self._poses: Any = None
        self._relay: Any = None
        self._simulator = self._truth_node.client(
            "simulator/change_parameters", SERVICES["change_parameters"]
        )
        self._truth_node.subscribe("truth", TOPICS["truth"].type_name, self._see)
        if self._node is not None:
            self._poses = self._node.advertise(TOPICS["tracker_pose"])
            self._beats = self._node.advertise(TOPICS["station_heartbeat"])
            self._follow(self._node)
            threading.Thread(target=self._beat, daemon=True).start()

    def _bridge(self, stack: ExitStack) -> Callable[[], None]:
        """Forward the truth to the station's router, whenever that exists."""

        def run() -> None:
            while not self._closing.is_set():
                try:
                    session = loopback_session(self.station_port)
                except LinkError:
                    continue
                stack.callback(session.close)
                self._relay = Node(session, f"/{NAME}", "simulator").advertise(TOPICS["truth"])
                self._node = Node(session, f"/{NAME}", "ground")
                self._follow(self._node)
                return

        return run

    def _follow(self, node: Node) -> None:
        node.subscribe("status", TOPICS["status"].type_name, self._hear)

    def _hear(self, received: Received) -> None:
        self.status = messages.decode(received.payload, TOPICS["status"].type_name)
        self.status_at = time.monotonic()

    def _see(self, received: Received) -> None:
        stamp_ns, state = decode_odometry(received.payload)
        self.stamp, self.truth = stamp_ns * 1e-9, state
        if self._relay is not None:
            with suppress(LinkError):
                self._relay.put(received.payload, stamp_ns)
        if self._poses is not None:
            sample = np.zeros(1, POSE_SAMPLE)
            sample["stamp_ns"] = stamp_ns
            sample["position_w"] = state["position_w"]
            sample["quaternion_wb"] = state["quaternion_wb"]
            with suppress(LinkError):
                self._poses.put(pose_messages(sample).tobytes(), stamp_ns)
        self.watch(self.stamp, state)

    def _beat(self) -> None:
        number = 0
        while not self._closing.wait(BEAT_S):
            number += 1
            now_ns = time.time_ns()
            with suppress(LinkError):
                self._beats.put(encode_heartbeat(number, now_ns), now_ns)

    # ------------------------------------------------------------------ asking
    def ask(self, service: str, **fields: Any) -> Any | None:
        """Return the answer; None when there was none."""
        if self._node is None:
            return None
        kind = SERVICES[service]
        request = messages.new(
            f"{kind}_Request", request_id=secrets.token_hex(6), requester=REQUESTER, **fields
        )
        try:
            return self._node.client(self._asks + service, kind).call(request, 2.0)
        except LinkError:
            return None

    def do(self, service: str, **fields: Any) -> None:
        """Repeat a request until it is accepted. Raises NotFlownError with the last reason."""
        said = ["no answer"]

        def accepted() -> bool:
            answer = self.ask(service, **fields)
            if answer is not None and not answer.accepted:
                said[0] = str(answer.reason)
            return answer is not None and bool(answer.accepted)

        try:
            until(service, accepted, 30.0)
        except NotFlownError as error:
            raise NotFlownError(f"{error}: {said[0]}") from None

    def start(self, behavior: str, **arguments: Any) -> None:
        self.do("start_behavior", name=behavior, arguments=to_parameters(arguments))

    def change_simulator(self, **values: Any) -> None:
        """Change parameters of the simulator. Raises LinkError."""
        request = messages.new(
            "quadlab_msgs/srv/ChangeParameters_Request",
            request_id=secrets.token_hex(6),
            requester=REQUESTER,
            parameters=to_parameters({f"simulator.{name}": v for name, v in values.items()}),
        )
        self._simulator.call(request, 2.0)

    def told(self, **wanted: Any) -> bool:
        """Return whether a status younger than a second has these values."""
        status = self.status
        return time.monotonic() - self.status_at < 1.0 and all(
            getattr(status, name) == value for name, value in wanted.items()
        )
