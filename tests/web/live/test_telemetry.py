"""Signals have their defined values, gaps are gaps, and a page costs at most 5 kB/s."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import websockets.exceptions

from tests.support.clock import Clock
from vehicle_link import clock
from vehicle_link.lockstep import Page
from vehicle_link.messages import decode, encode, new
from web.latest import STALE, Live
from web.live import events
from web.live.telemetry import MOST_SIGNALS, NEVER, RATE, Ping, frame, parse_request, topics_of
from web.signals import INDEX, SIGNALS, describe, snapshot

QUARTER = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))  # x, y, z, w: 90 degrees of yaw


def values(live: Live) -> dict[str, float]:
    return dict(zip(INDEX, snapshot(live), strict=True))


def odometry(position: Any, orientation: Any = (0, 0, 0, 1), linear: Any = (0, 0, 0)) -> bytes:
    pose = {"pose": {"position": position, "orientation": orientation}}
    return encode(new("nav_msgs/Odometry", pose=pose, twist={"twist": {"linear": linear}}))


def test_names_are_unique_and_every_topic_has_an_age() -> None:
    assert len(INDEX) == len(SIGNALS)
    assert {signal.topic for signal in SIGNALS} <= STALE.keys()
    assert describe()["topics"] == list(STALE)


def test_velocity_is_turned_from_body_to_world_axes() -> None:
    live = Live(decode)
    live.put("state", odometry((1.0, 2.0, 3.0), QUARTER, (2.0, 0.5, 0.25)))
    now = values(live)
    assert [now[f"state.position.{a}"] for a in "xyz"] == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        [now[f"state.velocity.{a}"] for a in "xyz"], [-0.5, 2.0, 0.25], atol=1e-12
    )
    assert now["state.yaw"] == pytest.approx(90.0)


def test_angles_are_those_of_known_rotations() -> None:
    from quadrotor.plain_rotations import roll_pitch_yaw
    from web.view.shapes import wxyz_of

    half = math.radians(10.0)
    for axis, index in (("x", 0), ("y", 1), ("z", 2)):
        q = new("geometry_msgs/Quaternion", w=math.cos(half), **{axis: math.sin(half)})
        expected = [0.0, 0.0, 0.0]
        expected[index] = math.radians(20.0)
        np.testing.assert_allclose(roll_pitch_yaw(*wxyz_of(q)), expected, atol=1e-12)


def test_the_tracking_error_is_state_minus_reference() -> None:
    live = Live(decode)
    live.put("state", odometry((1.0, 2.0, 3.0), QUARTER))
    reference = new("quadlab_msgs/Reference", position=(0.9, 2.2, 3.0), yaw=math.pi)
    live.put("reference", encode(reference))
    now = values(live)
    np.testing.assert_allclose(
        [now[f"error.position.{a}"] for a in "xyz"], [0.1, -0.2, 0.0], atol=1e-12
    )
    assert now["error.distance"] == pytest.approx(math.hypot(0.1, 0.2))
    assert now["error.yaw"] == pytest.approx(-90.0)


def test_what_is_absent_or_stale_is_no_number() -> None:
    clock = Clock(10.0)
    live = Live(decode, clock)
    assert all(math.isnan(value) for value in snapshot(live))
    live.put("state", odometry((1.0, 2.0, 3.0)))
    assert values(live)["state.position.x"] == 1.0
    assert math.isnan(values(live)["error.position.x"]), "there is no reference"
    clock.now += STALE["state"] + 0.01
    assert math.isnan(values(live)["state.position.x"])
    assert live.age("state") == pytest.approx(STALE["state"] + 0.01)
    assert live.newest("state") is not None, "the last one can still be shown, grey"


def test_a_frame_can_be_read_back() -> None:
    raw = frame(7, 1234.5, [0.010, math.inf, 0.2], [1.5, math.nan])
    identity, count, stamp, *rest = struct.unpack("<HHd3H2f", raw)
    assert (identity, count, stamp) == (7, 2, 1234.5)
    assert rest[:3] == [10, NEVER, 200]
    assert rest[3] == 1.5
    assert math.isnan(rest[4])


@pytest.mark.parametrize(("signals", "most"), [(40, 4800), (MOST_SIGNALS, 10600)])
def test_what_a_page_costs_a_second(signals: int, most: int) -> None:
    topics = topics_of([signal.name for signal in SIGNALS[:signals]])
    largest = frame(0, 0.0, [0.0] * len(topics), [0.0] * signals)
    websocket_head = 4
    assert (len(largest) + websocket_head) * RATE <= most


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        '{"id": 1}',
        '{"ping": "now"}',
        '{"ping": 1, "id": 2}',
        '{"id": 1, "signals": ["no.such"]}',
        '{"id": 1, "signals": ["= abs(no.such)"]}',
        '{"id": -1, "signals": []}',
        '{"id": 70000, "signals": []}',
        '{"id": 1, "signals": [3]}',
        json.dumps({"id": 1, "signals": ["thrust"] * (MOST_SIGNALS + 1)}),
    ],
)
def test_a_bad_subscription_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        parse_request(text)


def test_frames_follow_the_subscription(site: Any, operator: httpx.Client, station: Any) -> None:
    names = ["state.position.x", "mass", "thrust"]
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        page.send(json.dumps({"id": 9, "signals": names}))
        while True:
            station.fly(x=1.25)
            raw = page.recv(timeout=10.0)
            identity, count = struct.unpack_from("<HH", raw)
            if identity == 9:
                break
        assert count == 3
        assert topics_of(names) == ["state", "actuators", "estimator"]
        start = 12 + 2 * 3
        np.testing.assert_allclose(struct.unpack_from("<3f", raw, start), (1.25, 1.31, 12.8))
        page.send(json.dumps({"id": 10, "signals": ["no.such"]}))
        with pytest.raises(websockets.exceptions.ConnectionClosed, match="unknown signal"):
            drain(page)


def test_a_derived_signal_comes_in_the_frames_and_a_wrong_one_says_why(
    site: Any, operator: httpx.Client, station: Any
) -> None:
    texts = ["twice [kg] = 2*mass", "= integral(mass)", "= abs(no.such)"]
    twice, rate, wrong = operator.get("/api/expressions", params={"text": texts}).json()
    assert (twice["label"], twice["unit"], twice["topic"]) == ("twice", "kg", "estimator")
    assert "no signal no.such" in wrong["problem"]
    names = [twice["name"], rate["name"], "thrust"]
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        page.send(json.dumps({"id": 9, "signals": names}))
        sums: list[float] = []
        while len(sums) < 3:
            station.fly()
            raw = page.recv(timeout=10.0)
            found = struct.unpack_from("<3f", raw, len(raw) - 12)
            if struct.unpack_from("<H", raw) == (9,) and np.isfinite(found).all():
                assert found[0] == pytest.approx(2 * 1.31)
                sums.append(found[1])
    assert sums == sorted(sums)
    assert sums[2] > sums[0]


def test_a_page_can_time_its_own_link(site: Any, operator: httpx.Client) -> None:
    assert parse_request('{"ping":12.5}') == Ping(12.5)
    with site.websocket("/ws/telemetry", site.cookie(operator)) as page:
        page.send('{"ping":12.5}')
        while not isinstance(answer := page.recv(timeout=10.0), str):
            pass
    assert json.loads(answer) == {"pong": 12.5}


def drain(page: Any) -> None:
    while True:
        page.recv(timeout=10.0)


def test_the_summary_tells_status_and_ages(site: Any, operator: httpx.Client, station: Any) -> None:
    station.fly()
    summary = operator.get("/api/summary").json()
    assert summary["status"]["mode"] == "armed"
    assert summary["status"]["flags"] == ["not_real_time"]
    assert summary["status"]["lateness_p99"] == pytest.approx(1.4e-4)
    assert summary["link"]["loss"] == pytest.approx(0.02)
    assert summary["battery"]["voltage"] == pytest.approx(15.6, abs=0.01)
    assert summary["age"]["state"] < 5.0


def test_the_real_time_factor_is_told_while_the_station_is_waited_for(
    site: Any, operator: httpx.Client, station: Any, tmp_path: Path
) -> None:
    page = Page(["quad1"], tmp_path)
    clock.follow(page.path)
    try:
        station.fly()
        operator.get("/api/summary")
        words = clock.page()
        assert words is not None
        words[clock.LIMIT], words[clock.FACTOR] = clock.monotonic_ns(), 40_000
        summary = operator.get("/api/summary").json()
        assert summary["station"]["real_time_factor"] == pytest.approx(0.04)
    finally:
        clock.follow(None)
        page.close()


def test_a_new_page_gets_the_lines_before_it(site: Any, operator: httpx.Client) -> None:
    site.station._hub.publish_from_thread(
        {"type": "event", "level": "warn", "text": "battery low", "source": "quad1", "stamp": 1.0}
    )
    while not operator.get("/api/events").json():
        pass
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        hello = json.loads(page.recv(timeout=10.0))
    assert hello["type"] == "hello"
    assert hello["vehicle"] == "quad1"
    assert "battery low" in [line["text"] for line in hello["events"]]


def test_a_summary_asked_for_does_not_wait_for_the_next(
    site: Any, operator: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(events, "RATE", 1e-3)
    with site.websocket("/ws/events", site.cookie(operator)) as page:
        assert json.loads(page.recv(timeout=10.0))["type"] == "hello"
        assert json.loads(page.recv(timeout=10.0))["type"] == "summary"
        site.station._hub.publish_from_thread(events.SUMMARY_NOW)
        kind = ""
        while kind != "summary":  # parameters may arrive in between; the next is 1000 s away
            kind = json.loads(page.recv(timeout=10.0))["type"]
