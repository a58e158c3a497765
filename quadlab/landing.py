"""Landing a flying vehicle before everything is stopped."""

from __future__ import annotations

import threading
from typing import Protocol

from quadrotor.errors import LinkError

LANDING_PATIENCE = 40.0


class StopRequest(Protocol):
    @property
    def at_once(self) -> bool: ...


def land_before_stopping(loopback_port: int, name: str, stop: StopRequest) -> None:
    """Land through the station and wait for motors off; gives up when asked twice or late."""
    from vehicle_link.messages import decode, new
    from vehicle_link.node import Node
    from vehicle_link.session import loopback_session

    heard = threading.Event()
    disarmed = threading.Event()

    def on_status(received) -> None:  # type: ignore[no-untyped-def]
        status = decode(received.payload, "quadlab_msgs/VehicleStatus")
        lands = status.armed and status.mode != "bench"  # there the end of the vehicle stops it
        (disarmed.clear if lands else disarmed.set)()
        heard.set()

    try:
        session = loopback_session(loopback_port)
    except LinkError as error:
        print(f"quadlab: not landed, the station is away ({error})", flush=True)
        return
    node = Node(session, f"/{name}", "stopping")
    try:
        node.subscribe("status", "quadlab_msgs/VehicleStatus", on_status)
        if not heard.wait(1.5) or disarmed.is_set():
            return
        print("quadlab: landing before stopping; Ctrl-C again stops at once", flush=True)
        request = new(
            "quadlab_msgs/srv/StartBehavior_Request", request_id="stopping",
            requester="quadlab up", name="land",
        )  # fmt: skip
        client = node.client("station/start_behavior", "quadlab_msgs/srv/StartBehavior")
        try:
            answer = client.call(request)
            if not answer.accepted:
                print(f"quadlab: {answer.reason}", flush=True)
        except LinkError as error:
            print(f"quadlab: {error}", flush=True)
        for _ in range(int(LANDING_PATIENCE / 0.1)):
            if stop.at_once or disarmed.wait(0.1):
                return
        print(f"quadlab: not on the ground after {LANDING_PATIENCE:.0f} s; stopping", flush=True)
    finally:
        node.close()
        session.close()
