"""A sample that Zenoh delivers to another topic's subscription is not accepted as that topic's."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from tests.waiting import wait_for
from vehicle_link.topics.rmw_keys import attachment, data_key
from vehicle_link.transport.misrouted import ESTABLISHED, FORGIVEN, KNOWN, PublisherTopics
from vehicle_link.transport.node import Node

GID = bytes(range(16))


@pytest.fixture
def known() -> PublisherTopics:
    topics = PublisherTopics()
    for _ in range(ESTABLISHED):
        assert topics.belongs(GID, "truth")
    return topics


def test_a_publisher_that_is_known_is_refused_elsewhere(known: PublisherTopics) -> None:
    assert not known.belongs(GID, "parameter_changes")
    assert known.belongs(GID, "truth")
    assert not known.belongs(GID, "parameter_changes")
    assert known.refused == 2


def test_one_hardly_known_may_go_on_elsewhere() -> None:
    topics = PublisherTopics()
    assert topics.belongs(GID, "state")
    assert topics.belongs(GID, "truth")
    assert topics.refused == 0


def test_who_goes_on_elsewhere_is_believed(known: PublisherTopics) -> None:
    found = [known.belongs(GID, "state") for _ in range(FORGIVEN + 2)]
    assert found == [False] * FORGIVEN + [True, True]


def test_publishers_not_heard_for_long_are_forgotten(known: PublisherTopics) -> None:
    for number in range(KNOWN):
        assert known.belongs(number.to_bytes(16, "big"), "status")
    assert known.belongs(GID, "state")


def test_a_stray_sample_does_not_reach_the_callback(
    caplog: pytest.LogCaptureFixture, one_session: Any
) -> None:
    node = Node(one_session, "/quad7", "listener")
    came, at_end = list[int](), threading.Event()

    def take(received: Any) -> None:
        came.append(received.sequence)
        if received.sequence == 99:
            at_end.set()

    for topic in ("joy", "stick"):
        node.subscribe(topic, "sensor_msgs/Joy", take)

    def put(topic: str, sequence: int) -> None:
        key = data_key(0, f"/quad7/{topic}", "sensor_msgs/Joy")
        one_session.put(key, b"", attachment=attachment(sequence, 1, GID[::-1]))

    for sequence in range(ESTABLISHED):
        put("stick", sequence)
    wait_for(lambda: len(came) == ESTABLISHED)
    put("joy", 50)
    put("stick", 99)
    assert at_end.wait(5.0)
    wait_for(lambda: "arrived as joy" in caplog.text)
    node.close()
    assert 50 not in came


@pytest.fixture
def one_session() -> Iterator[Any]:
    import zenoh

    config = zenoh.Config.from_json5(
        '{mode: "peer", scouting: {multicast: {enabled: false}, gossip: {enabled: false}}}'
    )
    with zenoh.open(config) as session:
        yield session
