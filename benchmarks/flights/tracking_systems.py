"""Poses through the true clients of tracking systems: how far their stamps are off, and its cost.

The simulator serves its poses, 100 a second, stamped and sent as they are taken; each system's
client receives them in real time, in all processes of `quadlab up`, on the ground. The stamps that
the vehicle gets are compared with the nearest of the truth: an offset shows itself if it is below
half of the 10 ms between two poses. The figure 8 is then flown in simulated time with such an
offset, without and with the delay that `tracker_delay` would identify.
"""

from __future__ import annotations

import time
from typing import cast

import numpy as np

from benchmarks.flights.experiment_flight import REST_TO_REST, fly
from benchmarks.harness import Report, Row, Size, Target
from benchmarks.page.laboratory import started
from quadrotor.errors import LinkError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Array
from vehicle_link.messages import decode
from vehicle_link.messages.records import PoseStamped
from vehicle_link.topics.table import TOPICS
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.node import Node
from vehicle_link.transport.publisher import Received

PORT, LINK_PORT, SERVER_PORT = 18300, 18310, 18320
POSES = 1000, 1000, 50  # of each size
PATIENCE = 120.0
ERROR = "position_rms_m"


def _offsets(system: str, count: int) -> Array:
    """Return by how much the stamps of `count` poses are too late, s."""
    words = ("--tracker", f"{system} --port {SERVER_PORT}")
    with started(PORT, LINK_PORT, *words):
        end = time.monotonic() + PATIENCE
        session = None
        while session is None:
            try:
                session = loopback_session(LINK_PORT)
            except LinkError:
                if time.monotonic() > end:
                    raise
                time.sleep(1.0)
        node, stamps = Node(session, "/quad1", "tracking_systems"), {}
        for topic in ("truth", "tracker_pose"):
            stamps[topic] = list[int]()
            _follow(node, topic, stamps[topic])
        while len(stamps["tracker_pose"]) < 2 * count and time.monotonic() < end:
            time.sleep(0.5)
        node.close()
        session.close()
    poses, truth = np.array(stamps["tracker_pose"][-count:]), np.sort(stamps["truth"])
    after = np.clip(np.searchsorted(truth, poses), 1, len(truth) - 1)
    late = np.stack([poses - truth[after - 1], poses - truth[after]])
    nearest = np.abs(late).argmin(axis=0)
    return np.asarray(1e-9 * late[nearest, np.arange(len(poses))])


def _follow(node: Node, topic: str, stamps: list[int]) -> None:
    kind = TOPICS[topic].type_name

    def received(message: Received) -> None:
        stamp = cast("PoseStamped", decode(message.payload, kind)).header.stamp
        stamps.append(stamp.sec * 1_000_000_000 + stamp.nanosec)

    node.subscribe(topic, kind, received)


def _error(late: float, delay: float, size: Size) -> float:
    """Return the rms error of the figure 8, mm, with stamps too late by that much, s."""
    settings: dict[str, ParameterValue] = {
        "tracker.stamp_error": late,
        "estimation.tracker.delay": delay,
        **size.of({}, {}, REST_TO_REST),
    }
    return 1e3 * fly("figure_eight", settings).result.metrics[ERROR]


def run(size: Size = Size.FULL) -> Report:
    """Measure each system, and fly its offset."""
    poses = size.of(*POSES)
    report = Report(
        "tracking_systems",
        "Through the clients of tracking systems",
        [
            f"stamps of {poses} poses on the ground, in real time, all processes of quadlab up",
            "figure 8 in simulated time with the median offset",
        ],
    )
    built_in = _error(0.0, 0.0, size)
    report.rows.append(Row("built-in tracker", {"figure 8, mm rms": built_in}))
    for system in size.of(("vrpn", "natnet", "qtm"), ("natnet",), ("natnet",)):
        late = _offsets(system, poses)
        middle = float(np.median(late))
        plain = _error(middle, 0.0, size)
        report.rows.append(
            Row(
                system,
                {
                    "stamps too late, ms": 1e3 * middle,
                    "deviation, ms": 1e3 * float(late.std()),
                    "figure 8, mm rms": plain,
                    "with the delay set": _error(middle, middle, size),
                },
            )
        )
        report.targets.append(
            Target(f"{system}, times the built-in tracker", plain / built_in, 1.1)
        )
    return report
