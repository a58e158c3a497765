"""Foxglove's own client gets what the hub carries, with its person's permissions on the page."""

from __future__ import annotations

import contextlib
import json
import re
import struct
import time
from collections.abc import Callable
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import numpy as np
import pytest
import websockets.exceptions

from extensions.foxglove import client as one_client
from extensions.foxglove.catalogue import CHANNELS
from vehicle_link.messages import encode, header, new, ros_name
from vehicle_link.topics.table import TOPICS, TRACKER_PICTURES
from web.access import sign_in_tokens

Connect = Callable[..., Any]
FOXGLOVE = "https://app.foxglove.dev"


def odometry(x: float) -> Any:
    pose = {"pose": {"position": (x, 2.0, 3.0)}}
    return new("nav_msgs/Odometry", header=header(5_000_000_007), pose=pose)


@pytest.mark.parametrize("subprotocol", ["foxglove.websocket.v1", "foxglove.sdk.v1"])
def test_a_client_is_told_what_there_is(
    viewer: httpx.Client, connect: Connect, subprotocol: str
) -> None:
    client = connect(viewer, subprotocol)
    info = client.event("serverInfo")
    assert info["capabilities"] == ["parameters", "parametersSubscribe", "services"]
    assert info["supportedEncodings"] == ["cdr"]
    channels = {one["topic"]: one for one in client.event("advertise")}
    state = channels["/quad1/state"]
    assert state["schemaName"] == "nav_msgs/msg/Odometry"
    assert (state["encoding"], state["schemaEncoding"]) == ("cdr", "ros2msg")
    assert (
        channels.pop("/quad1/bearing_cones")["schemaName"] == "visualization_msgs/msg/MarkerArray"
    )
    for topic, one in channels.items():
        row = TOPICS.get(topic.removeprefix("/quad1/")) or TOPICS[topic]
        assert one["schemaName"] == ros_name(row.type_name)
    assert "/quad1/telemetry" not in channels  # it would arrive over the radio a second time
    services = {one["name"]: one["type"] for one in client.event("advertiseServices")}
    assert services["/quad1/arm"] == "quadlab_msgs/srv/Command"


def test_the_bytes_of_a_message_are_handed_on_unchanged(
    viewer: httpx.Client, connect: Connect, station: Any, until: Callable[..., None]
) -> None:
    client = connect(viewer)
    client.event("advertise")
    assert station.forwarded == set()
    client.do("subscribe", "/quad1/state")
    until(lambda: station.forwarded == {"state"})
    message = odometry(1.25)
    station.deliver("state", message, received_ns=1_700_000_000_123_456_789)
    came = client.event("message")
    assert bytes(came["bytes"]) == encode(message)
    assert came["timestamp"] == "1700000000123456789"
    assert came["content"]["pose"]["pose"]["position"] == {"x": 1.25, "y": 2, "z": 3}
    client.do("unsubscribe", client_subscription := 0)
    assert client_subscription == 0
    until(lambda: station.forwarded == set())


def test_cones_are_drawn_from_bearings_that_the_client_did_not_ask_for(
    viewer: httpx.Client, connect: Connect, station: Any, until: Callable[..., None]
) -> None:
    client = connect(viewer)
    client.event("advertise")
    client.do("subscribe", "/quad1/bearing_cones")
    until(lambda: station.forwarded == {"bearings", "neighbour_bearings"})
    fields = {"header": header(5_000_000_007), "sigma": 0.02}
    station.deliver("bearings", new("quadlab_msgs/BearingArray", **fields))  # draws nothing
    up = {"beacon_ids": [3], "bearings": [(0.0, 0.0, 1.0)]}
    station.deliver("bearings", new("quadlab_msgs/BearingArray", **fields, **up))
    (marker,) = client.event("message")["content"]["markers"]
    assert marker["header"]["frame_id"] == "quad1/body"
    heights = [point["z"] for point in marker["points"]]
    assert heights == pytest.approx([0.0, 1.5 * np.cos(0.06), 1.5 * np.cos(0.06)] * 12)


def test_a_topic_stays_subscribed_while_one_of_two_clients_wants_it(
    viewer: httpx.Client, connect: Connect, station: Any, until: Callable[..., None]
) -> None:
    first, second = connect(viewer), connect(viewer)
    for client in (first, second):
        client.event("advertise")
        client.do("subscribe", "/quad1/imu")
        client.event("subscribed")
    second.do("subscribe", "/quad1/state")
    until(lambda: station.forwarded == {"imu", "state"})
    second.do("close")
    until(lambda: station.forwarded == {"imu"})
    first.do("close")
    until(lambda: station.forwarded == set())


def test_parameters_are_read_set_and_followed(
    operator: httpx.Client,
    viewer: httpx.Client,
    connect: Connect,
    station: Any,
    until: Callable[..., None],
) -> None:
    station.fly()
    until(lambda: bool(operator.get("/api/parameters").json()["parameters"]))
    client, other = connect(operator), connect(viewer)
    for one in (client, other):
        one.event("advertise")
        one.do("subscribeParameterUpdates", ["gains.kp"])
        one.do("getParameters", ["gains.kp", "gains.rate", "nonsense"], "first")
        found = one.event("parameterValues")
        assert (found["id"], found["parameters"]) == (
            "first",
            [
                {"name": "gains.kp", "value": 4.0, "type": "float64"},
                {"name": "gains.rate", "value": "nominal"},
            ],
        )
    client.do("setParameters", [{"name": "gains.kp", "value": 5}], "second")
    changed = {"name": "gains.kp", "value": 5.0, "type": "float64"}
    assert other.event("parameterValues") == {"op": "parameterValues", "parameters": [changed]}
    assert station.store.values()["gains.kp"] == 5.0
    other.do("setParameters", [{"name": "gains.kp", "value": 6}], "third")
    assert "viewer" in other.event("status")["message"]
    assert other.event("parameterValues")["parameters"] == [changed]
    client.do("setParameters", [{"name": "gains.kp", "value": "much"}], "fourth")
    assert "gains.kp" in client.event("status")["message"]
    assert station.store.values()["gains.kp"] == 5.0
    client.do("setParameters", [{"name": "gains.kp", "value": 4.0}])


def test_a_service_is_called_in_the_name_of_who_signed_in(
    operator: httpx.Client, connect: Connect, station: Any
) -> None:
    client = connect(operator)
    client.event("advertiseServices")
    request = {
        "request_id": "",
        "requester": "someone else",
        "name": "circle",
        "arguments": [{"name": "radius", "value": {"type": 3, "double_value": 1.5}}],
    }
    client.do("call", "/quad1/start_behavior", request, 7)
    answer = client.event("serviceCallResponse")
    assert (answer["callId"], answer["encoding"], answer["content"]["accepted"]) == (7, "cdr", True)
    name, asked = station.requests[-1]
    label = operator.get("/api/session").json()["label"]
    assert (name, asked.name, asked.requester) == ("start_behavior", "circle", label)
    assert (asked.arguments[0].name, asked.arguments[0].value.double_value) == ("radius", 1.5)
    assert asked.request_id
    client.do("call", "/quad1/mark", {"text": "here"}, 8)
    assert client.event("serviceCallResponse")["content"]["accepted"]
    mark = station.requests[-1][1]
    assert mark.text == "here"
    assert 0 <= time.time_ns() - mark.pressed_ns < 60e9
    station.refusal = "ada has control"
    client.do("call", "/quad1/arm", {}, 9)
    refused = client.event("serviceCallResponse")["content"]
    assert (refused["accepted"], refused["reason"]) == (False, "ada has control")
    station.refusal, station.away = "", True
    client.do("call", "/quad1/arm", {}, 10)
    failed = client.event("serviceCallFailure")
    assert (failed["callId"], failed["message"]) == (10, str(station.silence))


def test_a_viewer_commands_nothing_but_an_emergency_landing(
    viewer: httpx.Client, operator: httpx.Client, connect: Connect, station: Any
) -> None:
    client = connect(viewer)
    client.event("advertiseServices")
    for number, (name, fields) in enumerate(
        [("arm", {}), ("emergency", {"action": "cut"}), ("mark", {}), ("emergency", {"action": ""})]
    ):
        client.do("call", f"/quad1/{name}", fields, number)
        answer = client.event("serviceCallResponse")["content"]
        assert not answer["accepted"]
        assert "operator" in answer["reason"]
    assert station.requests == []
    client.do("call", "/quad1/emergency", {"action": "land"}, 5)
    assert client.event("serviceCallResponse")["content"]["accepted"]
    assert [name for name, _ in station.requests] == ["emergency"]
    taker = connect(operator)
    taker.event("advertiseServices")
    taker.do("call", "/quad1/control", {"action": "take"}, 6)
    assert "admin" in taker.event("serviceCallResponse")["content"]["reason"]


def link(person: httpx.Client) -> str:
    """Return path and query of the live connection."""
    parts = urlsplit(person.post("/api/foxglove/link").json()["url"])
    return f"{parts.path}?{parts.query}"


def test_a_link_opens_the_viewers_which_only_watch(
    site: Any, admin: httpx.Client, station: Any
) -> None:
    made = admin.post("/api/foxglove/link").json()
    assert made["url"].startswith(f"ws://{site.host}/v/quad1/foxglove?token=")
    assert 0 < made["expires"] - time.time() <= sign_in_tokens.LINK_AGE
    for address in made["viewers"].values():
        query = parse_qs(urlsplit(address).query)
        assert query["ds"] == ["foxglove-websocket"]
        assert query["ds.url"][0].startswith(f"ws://{site.host}/v/quad1/foxglove?token=")
        watching = urlsplit(query["ds.url"][0])
        path = f"{watching.path}?{watching.query}"
        with site.websocket(path, cookie=None, subprotocol="foxglove.sdk.v1") as socket:
            for _ in range(3):
                socket.recv()
            gain = {"name": "gains.kp", "value": 6}
            socket.send(json.dumps({"op": "setParameters", "parameters": [gain], "id": "one"}))
            assert "may watch" in json.loads(socket.recv(timeout=20.0))["message"]
    assert station.store.values()["gains.kp"] != 6.0
    layout = admin.get("/api/foxglove/layout")
    assert "VEHICLE" not in layout.text
    assert "/quad1/state" in layout.text
    panels, there = layout.json()["configById"], json.dumps(layout.json()["layout"])
    there += json.dumps(panels["Tab!cameras"])
    assert set(re.findall(r'"(\w+![a-z]+)"', there)) == panels.keys()
    named = set(re.findall(r'(?:Topic"|"value"|ToRender"): "/quad1/(\w+)', layout.text))
    assert {"camera_picture", *TRACKER_PICTURES} <= named <= TOPICS.keys()


def refusal(site: Any, path: str, **arguments: Any) -> tuple[int, str]:
    with (
        pytest.raises(websockets.exceptions.InvalidStatus) as caught,
        site.websocket(path, **arguments),
    ):
        pass
    response = caught.value.response
    line = json.loads(response.body)["error"]
    assert "\n" not in line
    return response.status_code, line


def test_nothing_is_opened_without_a_session_or_with_a_wrong_token(
    site: Any, admin: httpx.Client, viewer: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    protocol = {"subprotocol": "foxglove.sdk.v1"}
    assert refusal(site, "/foxglove", cookie=None, **protocol)[0] == 401
    forged = link(viewer)[:-3] + "AAA"
    assert refusal(site, forged, cookie=None, **protocol)[0] == 401
    cookie = next(iter(viewer.cookies.values()))  # a session's cookie is no token
    assert refusal(site, f"/foxglove?token={cookie}", cookie=None, **protocol)[0] == 401
    good = link(viewer)
    # It opens nothing else, and a foreign page with only the session's cookie opens nothing.
    assert refusal(site, good.replace("foxglove?", "ws/events?"), cookie=None)[0] == 401
    own = site.cookie(viewer)
    assert refusal(site, "/foxglove", cookie=own, origin=FOXGLOVE, **protocol)[0] == 403
    with site.websocket(good, cookie=None, origin=FOXGLOVE, **protocol) as socket:
        assert json.loads(socket.recv())["op"] == "serverInfo"
        label = viewer.get("/api/session").json()["label"]
        admin.post(f"/api/users/{label}/end_sessions")
        ended = refusal(site, good, cookie=None, **protocol)
        assert ended[0] == 401
        with contextlib.suppress(websockets.exceptions.ConnectionClosedError):
            list(socket)
        assert socket.close_code == 4401
    monkeypatch.setattr(sign_in_tokens, "LINK_AGE", -1)
    expired = refusal(site, link(admin), cookie=None, **protocol)
    assert expired[0] == 401
    assert "expired" in expired[1]


def test_another_subprotocol_is_refused_with_what_is_allowed(
    site: Any, viewer: httpx.Client
) -> None:
    status, line = refusal(site, link(viewer), cookie=None, subprotocol="foxglove.websocket.v0")
    assert status == 400
    assert "foxglove.websocket.v0" in line
    assert "foxglove.sdk.v1" in line


BAD = (
    "nonsense",
    "[]",
    '{"op": "publish"}',
    '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 999}]}',
    '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 0}]}',
    '{"op": "subscribe"}',
    '{"op": "unsubscribe", "subscriptionIds": [77]}',
    '{"op": "getParameters", "parameterNames": 3}',
    '{"op": "advertise", "channels": []}',
    "[" * 5000,
    b"",
    b"\x01\x00\x00\x00\x00hello",
    struct.pack("<BIII", 2, 0, 1, 4) + b"json{}",
    struct.pack("<BIII", 2, 999, 1, 3) + b"cdr",
    struct.pack("<BIII", 2, 0, 1, 2**31) + b"cdr",
)


def test_garbage_is_answered_with_one_line_and_changes_nothing(
    site: Any, viewer: httpx.Client, station: Any
) -> None:
    with site.websocket(link(viewer), cookie=None, subprotocol="foxglove.sdk.v1") as socket:
        for _ in range(3):
            socket.recv()
        for bad in BAD:
            socket.send(bad)
            answer = json.loads(socket.recv(timeout=20.0))
            assert (answer["op"], answer["level"]) == ("status", 2), bad
            assert "\n" not in answer["message"]
        socket.send(struct.pack("<BIII", 2, 0, 9, 3) + b"cdr" + b"\xff" * 5)
        answer = json.loads(socket.recv(timeout=20.0))
        assert (answer["op"], answer["callId"]) == ("serviceCallFailure", 9)
        socket.send('{"op": "getParameters", "parameterNames": ["gains.kp"], "id": "still here"}')
        assert json.loads(socket.recv(timeout=20.0))["id"] == "still here"
    assert station.requests == []
    assert station.forwarded == set()


def test_a_client_that_reads_nothing_loses_messages_and_holds_up_nobody(
    site: Any,
    viewer: httpx.Client,
    connect: Connect,
    station: Any,
    until: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(one_client, "MOST_BYTES", 50_000)
    good = connect(viewer)
    good.event("advertise")
    good.do("subscribe", "/quad1/state")
    good.event("subscribed")
    everything = [{"id": n, "channelId": n} for n in range(len(CHANNELS))]
    with site.websocket(link(viewer), cookie=None, subprotocol="foxglove.sdk.v1") as deaf:
        deaf.recv()
        # From now on only the library's thread reads, up to its own bound.
        deaf.send(json.dumps({"op": "subscribe", "subscriptions": everything}))
        until(lambda: len(station.forwarded) == len(CHANNELS) - 1)  # cones are drawn here
        data = np.zeros(20_000, np.uint8)
        picture = new("sensor_msgs/CompressedImage", header=header(5), format="jpeg", data=data)
        for count in range(300):  # 6 MB, more than the sockets hold
            station.deliver("camera_picture", picture)
            station.deliver("state", odometry(float(count)))
            if count % 10 == 0:
                came = good.event("message")
        while came["content"]["pose"]["pose"]["position"]["x"] < 299:
            came = good.event("message")
        # It reads at last a part of the messages, and the newest.
        dropped, newest = 0, 0.0
        while not dropped:
            answer = deaf.recv(timeout=20.0)
            if isinstance(answer, str):
                status = json.loads(answer)
                if status["op"] == "status":
                    assert status["level"] == 1
                    dropped = int(status["message"].split()[0])
            else:
                newest = struct.unpack_from("<BIQ", answer)[2]
        assert 0 < dropped < 600
        assert newest > 0
        deaf.close_timeout = 0.1  # it does not read the answer to its farewell
