"""3D panels draw the vehicle's past and reference path, when they are due."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np
import pytest

from quadrotor.records import TICK, Record
from vehicle_link.messages import decode, encode, stamp_of
from vehicle_link.topics.scene import SceneMessages
from vehicle_link.topics.table import TOPICS

START_NS = 7_000_000_000
TICK_NS = 2_000_000


def flight(count: int, start_ns: int = START_NS) -> Record:
    """Return a circle of 1 m around (1, 2), and a reference 0.1 m above it.

    The shape is (count,), ticks at 500 Hz.
    """
    ticks = np.zeros(count, TICK)
    time = np.arange(count) * TICK_NS * 1e-9
    ticks["imu"]["stamp_ns"] = start_ns + np.arange(count) * TICK_NS
    around = np.column_stack([1 + np.cos(time), 2 + np.sin(time), np.full(count, 1.5)])
    ticks["state"]["position_w"] = around
    ticks["state"]["quaternion_wb"] = (0.5, 0.1, 0.7, math.sqrt(1 - 0.25 - 0.01 - 0.49))
    ticks["reference"]["position_w"] = around + np.array([0, 0, 0.1])
    ticks["reference"]["yaw"] = 0.8
    return ticks


def drawn(scene: SceneMessages, ticks: Record) -> list[tuple[str, Any]]:
    """Return each message decoded, after comparing its bytes with the general encoder's."""
    found = []
    for topic, payload, _ in scene.of(ticks):
        message = decode(payload, TOPICS[topic].type_name)
        assert encode(message) == payload
        found.append((topic, message))
    return found


def xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def test_transforms_are_the_estimate_and_the_reference() -> None:
    ticks = flight(1)
    (_, moving), (_, fixed) = drawn(SceneMessages("quad2"), ticks)[:2]
    body, reference = moving.transforms
    for one, child in ((body, "quad2/body"), (reference, "quad2/reference")):
        assert (one.header.frame_id, one.child_frame_id) == ("world", child)
        assert stamp_of(one) == START_NS
    assert xyz(body.transform.translation) == ticks["state"]["position_w"][0].tolist()
    turn = body.transform.rotation
    assert [turn.w, *xyz(turn)] == ticks["state"]["quaternion_wb"][0].tolist()
    assert xyz(reference.transform.translation) == ticks["reference"]["position_w"][0].tolist()
    turn = reference.transform.rotation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(0.8)
    assert (turn.x, turn.y) == (0, 0)
    frames = [(one.header.frame_id, one.child_frame_id) for one in fixed.transforms]
    assert frames == [("map", "world"), ("quad2/body", "quad2/base_link")]
    for one in fixed.transforms:
        assert [one.transform.rotation.w, *xyz(one.transform.translation)] == [1, 0, 0, 0]


def test_paths_end_where_the_vehicle_is_and_the_airframe_moves_with_it() -> None:
    scene, ticks = SceneMessages("quad1"), flight(15_001)
    whole = [message for topic, message in drawn(scene, ticks) if topic == "scene"]
    (newest,) = [one for one in whole if stamp_of(one.markers[0]) == START_NS + 30_000_000_000]
    *airframe, flown, wanted = newest.markers
    assert {one.header.frame_id for one in airframe} == {"quad1/body"}
    assert all(one.frame_locked for one in airframe)
    for marker, name in ((flown, "state"), (wanted, "reference")):
        path = np.array([xyz(point) for point in marker.points])
        assert marker.header.frame_id == "world"
        np.testing.assert_array_equal(path[-1], ticks[name]["position_w"][-1])
        # 20 s of points 0.2 s apart, all on the circle.
        np.testing.assert_allclose(np.hypot(path[:, 0] - 1, path[:, 1] - 2), 1.0, atol=1e-12)
        np.testing.assert_array_equal(path[1], ticks[name]["position_w"][15_000 - 97 * 100])
    assert len({(one.ns, one.id) for one in newest.markers}) == len(newest.markers)


@pytest.mark.parametrize("size", [1, 5, 100])
def test_each_topic_comes_at_its_rate_however_ticks_are_grouped(size: int) -> None:
    scene, ticks = SceneMessages("quad1"), flight(5000)
    groups = [ticks[start : start + size] for start in range(0, len(ticks), size)]
    count = Counter(topic for group in groups for topic, _, _ in scene.of(group))
    assert count == {"/tf": 500, "/tf_static": 10, "scene": 20}
    assert {name: TOPICS[name].rate * 10 for name in count} == count


def test_a_vehicle_that_starts_again_begins_a_new_path() -> None:
    scene = SceneMessages("quad1")
    scene.of(flight(5000))
    again = flight(1, start_ns=1_000)
    again["state"]["position_w"] = (9, 9, 9)
    found = dict(drawn(scene, again))
    assert found.keys() == {"/tf", "/tf_static", "scene"}
    flown = found["scene"].markers[-2]
    assert {tuple(xyz(point)) for point in flown.points} == {(9, 9, 9)}
