"""The scene moves with the vehicle, follows it when requested, and stays within its bandwidth."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import websockets.sync.client

from control.keep_out import parse_keep_out
from tests.support.clock import Clock
from tests.support.narrowing import now
from vehicle_link.messages import decode, encode, header, new
from web.latest import Live
from web.view.lines import edges as edges_of
from web.view.lines import line_color
from web.view.options import RAMP, ViewOptions
from web.view.scene import RATE, Scene
from web.view.server import SECRET_HEADER, VIEW_HEADER, ViewServer

BUDGET = 100_000  # bytes a second and client


def connect(server: ViewServer, name: str) -> Any:
    return websockets.sync.client.connect(
        server.url,
        subprotocols=[websockets.Subprotocol(f"viser-v{server.version}")],
        additional_headers={SECRET_HEADER: server.secret, VIEW_HEADER: name},
        compression=None,
        max_size=None,
        proxy=None,
    )


@pytest.fixture
def server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


def odometry(x: float, y: float, z: float) -> bytes:
    pose = {"pose": {"position": (x, y, z), "orientation": (0.0, 0.0, 0.0, 1.0)}}
    return encode(new("nav_msgs/Odometry", header=header(0), pose=pose))


def fly(live: Live, t: float) -> tuple[float, float, float]:
    """Fly a figure eight of 8 s, with changes of everything in every frame."""
    point = (math.sin(0.785 * t), 0.5 * math.sin(1.57 * t), 1.0 + 0.2 * math.sin(0.785 * t))
    live.put("state", odometry(*point))
    live.put("truth", odometry(point[0] + 0.01, point[1], point[2]))
    live.put("reference", encode(new("quadlab_msgs/Reference", position=point)))
    live.put("status", encode(new("quadlab_msgs/VehicleStatus", armed=True, airborne=True)))
    live.put("actuators", encode(new("quadlab_msgs/Actuators", motor_references=[127.0] * 4)))
    return point


def test_nodes_follow_the_newest_state(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    handles = server.viser.scene._handle_from_node_name
    assert not handles["/vehicle"].visible
    live.put("state", odometry(0.3, -0.2, 1.1))
    live.put("truth", odometry(0.31, -0.2, 1.1))
    scene.update(0.0)
    np.testing.assert_allclose(handles["/vehicle"].position, (0.3, -0.2, 1.1))
    np.testing.assert_allclose(handles["/truth"].position, (0.31, -0.2, 1.1))
    assert now(handles)["/vehicle"].visible
    assert now(handles)["/truth"].visible
    assert "/beacons/3/ball" in handles


def test_the_ghost_hides_when_there_is_no_truth(server: ViewServer) -> None:
    clock = Clock()
    live = Live(decode, clock)
    scene = Scene(server, live)
    live.put("truth", odometry(0.0, 0.0, 1.0))
    scene.update(0.0)
    ghost = server.viser.scene._handle_from_node_name["/truth"]
    assert ghost.visible
    clock.now += 5.0
    scene.update(5.0)
    assert not ghost.visible


def test_propellers_turn_only_when_armed(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    rotors = [server.viser.scene._handle_from_node_name[f"/vehicle/rotor_{i}"] for i in range(4)]
    live.put("actuators", encode(new("quadlab_msgs/Actuators", motor_references=[127.0] * 4)))
    live.put("status", encode(new("quadlab_msgs/VehicleStatus", armed=False)))
    scene.update(0.0)
    assert all(rotor.wxyz[3] == 0.0 for rotor in rotors)
    live.put("status", encode(new("quadlab_msgs/VehicleStatus", armed=True)))
    scene.update(0.0)
    turns = [rotor.wxyz[0] * rotor.wxyz[3] for rotor in rotors]  # half the sine of the angle
    assert turns[0] < 0.0, "the front one turns clockwise: its torque on the body is +c f"
    assert np.sign(turns[0]) == np.sign(turns[2]) == -np.sign(turns[1])
    assert np.sign(turns[1]) == np.sign(turns[3])


def test_a_moving_scene_stays_within_its_bandwidth(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    scene.set_volume(((-3, 3), (-3, 3), (0, 3)))
    received = 0
    quiet = threading.Event()

    with connect(server, "a") as socket:

        def read() -> None:
            nonlocal received
            for frame in socket:
                received += len(frame)
                quiet.clear()

        threading.Thread(target=read, daemon=True).start()
        settle(quiet)
        received, frames = 0, 90
        for k in range(frames):
            fly(live, k / RATE)
            scene.update(k / RATE)
            time.sleep(1.0 / RATE)  # viser sends windows of 1/60 s; this is the load, not a wait
        settle(quiet)
        rate = received * RATE / frames
    print(f"scene: {rate / 1e3:.1f} kB/s")
    assert 3_000 < rate < BUDGET


def settle(quiet: threading.Event) -> None:
    """Wait until nothing has arrived for 0.2 s."""
    for _ in range(100):
        quiet.set()
        time.sleep(0.2)
        if quiet.is_set():
            return
    pytest.fail("the scene never came to rest")


def test_a_resting_scene_sends_nothing(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    live.put("state", odometry(0.0, 0.0, 1.0))
    scene.update(0.0)
    buffer = server.viser._websock_server._broadcast_buffer
    before = buffer.message_counter
    for k in range(30):
        scene.update(k / RATE)
    assert buffer.message_counter == before


def test_the_camera_follows_only_the_page_that_asked(server: ViewServer, until: Any) -> None:
    import msgspec

    live = Live(decode)
    scene = Scene(server, live)
    camera = {
        "type": "ViewerCameraMessage",
        "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [-2.0, 0.0, 2.0],
        "fov": 1.0,
        "near": 0.01,
        "far": 100.0,
        "image_height": 400,
        "image_width": 640,
        "look_at": [0.0, 0.0, 1.0],
        "up_direction": [0.0, 0.0, 1.0],
    }
    with connect(server, "mine") as mine, connect(server, "other") as other:
        for socket in (mine, other):
            socket.send(msgspec.msgpack.encode(camera))
        until(lambda: len(server.clients_of({"mine", "other"})) == 2)
        scene.cameras.choose("mine", "follow")
        live.put("state", odometry(1.0, 0.5, 1.5))
        scene.update(0.0)
        clients = server.clients_of({"mine", "other"})
        np.testing.assert_allclose(clients["mine"].camera.look_at, (1.0, 0.5, 1.5))
        np.testing.assert_allclose(clients["mine"].camera.position, (-1.0, 0.5, 2.5))
        np.testing.assert_allclose(clients["other"].camera.look_at, (0.0, 0.0, 1.0))
        scene.cameras.choose("mine", "free")
        live.put("state", odometry(2.0, 0.5, 1.5))
        scene.update(0.1)
        np.testing.assert_allclose(clients["mine"].camera.look_at, (1.0, 0.5, 1.5))


def test_a_box_has_twelve_edges_along_the_axes() -> None:
    edges = edges_of(((-1.0, 2.0), (0.0, 1.0), (3.0, 7.0)))
    assert edges.shape == (12, 2, 3)
    lengths = sorted(float(np.abs(b - a).sum()) for a, b in edges)
    assert lengths == [1.0] * 4 + [3.0] * 4 + [4.0] * 4
    assert len({tuple(map(tuple, edge)) for edge in edges}) == 12


def test_a_tab_that_stood_still_gets_the_newest_and_no_history(server: ViewServer) -> None:
    """A stalled page that wakes up gets a small part of what was sent in the meantime."""
    import socket as sockets

    live = Live(decode)
    scene = Scene(server, live)
    raw = sockets.socket()
    raw.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVBUF, 4096)
    raw.connect(("127.0.0.1", server.port))
    stalled = websockets.sync.client.connect(
        server.url,
        sock=raw,
        subprotocols=[websockets.Subprotocol(f"viser-v{server.version}")],
        additional_headers={SECRET_HEADER: server.secret},
        compression=None,
        max_size=None,
        max_queue=1,
        proxy=None,
    )
    received = dict.fromkeys(("awake", "stalled"), 0)
    quiet = threading.Event()

    def read(name: str, socket: Any) -> None:
        for frame in socket:
            received[name] += len(frame)
            quiet.clear()

    with connect(server, "awake") as awake, stalled:
        threading.Thread(target=read, args=("awake", awake), daemon=True).start()
        settle(quiet)
        received["awake"] = 0
        for k in range(240):
            fly(live, k / RATE)
            scene.update(k / RATE)
            time.sleep(1.0 / 60.0)
        settle(quiet)
        threading.Thread(target=read, args=("stalled", stalled), daemon=True).start()
        settle(quiet)
    print(received)
    # The stalled page still had to get the whole scene, about 30 kB.
    assert 0 < received["stalled"] < 0.5 * received["awake"]


def test_a_planned_path_stays_until_it_has_been_flown(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    plan: Any = server.viser.scene._handle_from_node_name["/plan"]
    at = time.monotonic()
    scene.plan(np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1]], np.float32))
    np.testing.assert_array_equal(plan.points[1], [[1, 0, 1], [1, 1, 1]])
    following = new("quadlab_msgs/VehicleStatus", behavior="FOLLOW_TRAJECTORY", airborne=True)
    live.put("status", encode(following))
    scene.update(at + 500.0)
    assert plan.visible
    live.put("status", encode(new("quadlab_msgs/VehicleStatus", behavior="HOVER", airborne=True)))
    scene.update(at + 501.0)
    assert plan.visible
    assert scene.is_plan_shown
    scene.update(at + 503.0)
    assert not plan.visible
    assert not scene.is_plan_shown


def test_layers_are_hidden_and_the_error_is_drawn_magnified(server: ViewServer) -> None:
    live = Live(decode)
    scene = Scene(server, live)
    scene.set_volume(((-3, 3), (-3, 3), (0, 3)))
    scene.boxes.set_boxes(parse_keep_out("pillar 1 2 -1 1 0 3; desk 0 1 2 3 0 1"))
    scene.boxes.set_boxes(parse_keep_out("pillar 1 2 -1 1 0 3"))
    handles = now(server.viser.scene._handle_from_node_name)
    pillar: Any = handles["/keep_out/0"]
    assert (tuple(pillar.position), tuple(pillar.dimensions)) == ((1.5, 0.0, 1.5), (1.0, 2.0, 3.0))
    assert (pillar.visible, handles["/keep_out/1"].visible) == (True, False)
    scene.show(ViewOptions(truth=False, volume=False, ground=False, error=True, magnified=50))
    fly(live, 0.0)
    live.put("state", odometry(0.0, 0.0, 1.02))
    scene.update(0.0)
    assert not now(pillar).visible
    shown = {name: handles[name].visible for name in ("/truth", "/volume", "/ground", "/error")}
    assert shown == {"/truth": False, "/volume": False, "/ground": False, "/error": True}
    error: Any = handles["/error"]
    np.testing.assert_allclose(error.points[0], [[0.0, 0.0, 1.02], [0.0, 0.0, 0.02]], atol=1e-5)


def test_the_path_has_the_colours_of_the_chosen_signal_from_its_choice_on(
    server: ViewServer,
) -> None:
    live = Live(decode, lambda: 0.0)
    scene = Scene(server, live)
    for k in range(4):
        if k == 2:
            scene.show(ViewOptions(color="error"))
        x, y, z = fly(live, 0.1 * k)
        live.put("state", odometry(x, y, z - 0.1))
        scene.update(0.1 * k)
    head: Any = now(server.viser.scene._handle_from_node_name)["/flown/head"]
    assert head.colors[0, 0].tolist() == list(line_color(RAMP[-1]))
    scene.show(ViewOptions())
    assert head.colors.shape == (3,)
