"""A message that arrives by the lane and over Zenoh is passed on once, and in order."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from vehicle.comms.lane import CommsLane
from vehicle_link.transport.publisher import Received

BOUND = 20.0  # s
HELD_BACK = 0.3
"""Longest delay, in s; it ends earlier only if an event happens that must not."""
POSE, BEAT = "tracker_pose", "station_heartbeat"
FIRST = Received(b"", 1, 0, 0, b"of the station")


class Ways:
    """Lane without datagrams, and node without a network.

    Attributes:
        by_zenoh: called with a message received over Zenoh, by topic.
        by_lane: called with (topic, message).
        order: topics that were passed on; those reported by the lane have the prefix "told ".
        handing_on: called before each is passed on.
    """

    def __init__(self) -> None:
        self.by_zenoh: dict[str, Callable[[Received], None]] = {}
        self.order: list[str] = []
        self.handing_on: Callable[[], None] = lambda: None
        node: Any = self
        self.lane = CommsLane(node, 0, lambda topic, _: self.order.append(f"told {topic}"))
        self.by_lane = self.lane._lane._deliver
        for topic in (POSE, BEAT):
            self.lane.subscribe(topic, partial(self._hand_on, topic))
        self.lane._subscribe(node, POSE)

    def serve(self, *_: Any) -> None: ...

    def subscribe(self, topic: str, _: str, callback: Callable[[Received], None]) -> None:
        self.by_zenoh[topic] = callback

    def _hand_on(self, topic: str, _: Received) -> None:
        self.handing_on()
        self.order.append(topic)


@pytest.fixture
def ways() -> Iterator[Ways]:
    made = Ways()
    yield made
    made.lane.close()


def test_a_heartbeat_is_told_of_when_the_pose_before_it_is_handed_on(ways: Ways) -> None:
    """Zenoh received the pose first, and its thread is delayed before it has passed it on."""
    has_begun, is_told = threading.Event(), threading.Event()

    def held_back() -> None:
        has_begun.set()
        is_told.wait(HELD_BACK)

    ways.handing_on = held_back
    zenoh = threading.Thread(target=ways.by_zenoh[POSE], args=(FIRST,))
    zenoh.start()
    assert has_begun.wait(BOUND)
    ways.handing_on = lambda: None
    ways.by_lane(POSE, FIRST)
    ways.by_lane(BEAT, FIRST)
    is_told.set()
    zenoh.join(BOUND)
    assert ways.order == [POSE, f"told {POSE}", BEAT, f"told {BEAT}"]


def test_of_a_heartbeat_over_zenoh_nothing_is_told_for_poses_may_come_after_it(ways: Ways) -> None:
    ways.by_zenoh[BEAT](FIRST)
    assert ways.order == [BEAT]
    ways.by_lane(POSE, FIRST)
    ways.by_lane(BEAT, FIRST)
    assert ways.order == [BEAT, POSE, f"told {POSE}", f"told {BEAT}"]
