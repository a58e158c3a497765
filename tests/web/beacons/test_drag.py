"""Dragged beacons: permissions, meaning of a drag, and handles that follow the confirmed layout."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np
import pytest

from bearing_sim.beacons import PAPER_BEACONS, PRESETS
from tests.support.camera_message import camera_message
from vehicle_link.messages import decode
from web.access.roles import Role, Session
from web.latest import Live
from web.view.beacons.scene import BeaconScene, BeaconView
from web.view.drag import SETTLING, BeaconDrags, Drag, drag_of
from web.view.proxy import HostileError, Upstream, eye_of
from web.view.scene import RATE
from web.view.server import ViewServer

encode = msgspec.msgpack.encode
HANDLE = "/beacons/0/handle"
EYE = (-2.0, -2.0, 3.0)
CAMERA = camera_message(EYE)


def message(
    phase: str, pointer: tuple[float, float, float], name: str = HANDLE, **other: Any
) -> bytes:
    """Return a message in the form that viser's client sends."""
    return encode(
        {
            "type": "SceneNodeDragMessage",
            "phase": phase,
            "name": name,
            "instance_index": None,
            "start_position": [0.0, 0.0, 0.0],
            "start_screen_pos": [0.5, 0.5],
            "end_position": list(pointer),
            "end_screen_pos": [0.5, 0.5],
            "button": "left",
            "modifier": None,
            "owner": "",
            **other,
        }
    )


def toward(place: tuple[float, float, float], share: float = 0.6) -> tuple[float, float, float]:
    """Return a point on the line of sight to a place, where viser's own drag plane might be."""
    x, y, z = (e + share * (p - e) for e, p in zip(EYE, place, strict=True))
    return (x, y, z)


@pytest.fixture(scope="module")
def shared_server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


class Table:
    """Scene, its operator's page and the moves; frames advance the time."""

    def __init__(self, server: ViewServer) -> None:
        server.viser.scene.reset()
        self.scene = BeaconScene(server, Live(decode))
        self.moved: list[tuple[int, tuple[float, float, float], str]] = []
        self.scene.on_moved(lambda *move: self.moved.append(move))
        self.scene.show(BeaconView(drag=True))
        self.page = Upstream(server, Session("operator 3", Role.OPERATOR))
        self.page.takes(encode(CAMERA))
        self.nodes = server.viser.scene._handle_from_node_name
        self.now = 50.0
        self.frames(1)

    def frames(self, count: int) -> None:
        for _ in range(count):
            self.now += 1.0 / RATE
            self.scene.update(self.now)

    def drag(self, phase: str, place: tuple[float, float, float], name: str = HANDLE) -> None:
        assert not self.page.takes(message(phase, toward(place), name)), "it ends at the pump"


@pytest.fixture
def table(shared_server: ViewServer) -> Table:
    return Table(shared_server)


def test_an_operators_drag_moves_the_beacon_in_its_plane(table: Table) -> None:
    table.drag("start", (1.02, 0.99, 0.1))  # grabbed next to its middle
    table.drag("update", (1.22, 0.79, 0.1))
    table.frames(1)
    [(id, position, who)] = table.moved
    assert (id, who) == (1, "operator 3")
    assert position == pytest.approx((1.2, 0.8, 0.1))


def test_positions_come_ten_times_a_second_and_the_last_one_always(table: Table) -> None:
    table.drag("start", (1.0, 1.0, 0.1))
    for k in range(1, 31):
        table.drag("update", (1.0 + 0.01 * k, 1.0, 0.1))
        table.frames(1)
    table.drag("end", (1.305, 1.0, 0.1))
    table.frames(10)
    assert 9 <= len(table.moved) <= 12
    assert table.moved[-1][1] == pytest.approx((1.305, 1.0, 0.1))
    xs = [position[0] for _, position, _ in table.moved]
    assert xs == sorted(xs)
    table.frames(60)
    assert len(table.moved) <= 12, "nothing more once it is over"


def test_nothing_moves_in_the_view_before_it_is_confirmed(table: Table) -> None:
    ball, wanted = "/beacons/0", f"{HANDLE}_wanted"
    table.drag("start", (1.0, 1.0, 0.1))
    table.drag("update", (1.5, 1.0, 0.1))
    table.frames(5)
    np.testing.assert_allclose(table.nodes[ball].position, (1.0, 1.0, 0.1))
    assert table.nodes[wanted].visible
    np.testing.assert_allclose(table.nodes[wanted].position, (0.5, 0.0, 0.0), atol=1e-9)
    table.drag("end", (1.5, 1.0, 0.1))
    table.scene.set_beacons(PAPER_BEACONS.moved(1, (1.5, 1.0, 0.1)), 0.026)
    table.frames(1)
    np.testing.assert_allclose(table.nodes[ball].position, (1.5, 1.0, 0.1))
    assert not table.nodes[wanted].visible


def test_a_refused_move_leaves_beacon_and_handle_where_they_were(table: Table) -> None:
    table.scene.on_moved(lambda *_: table.scene.put_back())
    table.drag("start", (1.0, 1.0, 0.1))
    table.drag("update", (1.5, 1.0, 0.1))
    table.frames(2)
    np.testing.assert_allclose(table.nodes["/beacons/0"].position, (1.0, 1.0, 0.1))
    np.testing.assert_allclose(table.nodes[HANDLE].position, (0.0, 0.0, 0.0))
    wanted = table.nodes.get(f"{HANDLE}_wanted")
    assert wanted is None or not wanted.visible


def test_an_answer_that_never_comes_is_not_waited_for(table: Table) -> None:
    table.drag("start", (1.0, 1.0, 0.1))
    table.drag("end", (1.5, 1.0, 0.1))
    table.frames(5)
    wanted = table.nodes[f"{HANDLE}_wanted"]
    assert wanted.visible
    table.frames(round((SETTLING + 0.2) * RATE))
    assert not wanted.visible


def test_handles_are_there_only_to_drag_with(table: Table, shared_server: ViewServer) -> None:
    assert set(shared_server.draggable) == {f"/beacons/{k}/handle" for k in range(4)}
    assert table.nodes[HANDLE].visible
    table.scene.show(BeaconView(drag=False))
    assert not shared_server.draggable
    assert not table.nodes[HANDLE].visible
    for phase in ("start", "update", "end"):
        table.drag(phase, (1.5, 1.0, 0.1))
    table.frames(5)
    assert table.moved == []
    table.scene.show(BeaconView(drag=True))
    table.scene.set_beacons(PRESETS["eight"], 0.026)
    assert len(shared_server.draggable) == 8
    table.scene.set_beacons(PRESETS["wide"], 0.026)
    assert len(shared_server.draggable) == 4
    assert not table.nodes["/beacons/7/handle"].visible


def test_a_beacon_of_a_wall_stays_in_it(table: Table) -> None:
    table.scene.set_beacons(PRESETS["wall"], 0.026)
    table.drag("start", (2.5, 1.0, 0.5))
    table.drag("update", (2.5, 0.7, 1.1))
    table.frames(1)
    [(id, position, _)] = table.moved
    assert id == 1
    assert position == pytest.approx((2.5, 0.7, 1.1))


@pytest.mark.parametrize(
    "pointer",
    [
        (math.nan, 0.0, 0.0),
        (math.inf, 0.0, 0.0),
        (-2.0, -2.0, 4.0),  # the sky
        (1e9, 1e9, 3.0 - 1e-3),  # the horizon
        EYE,
    ],
)
def test_a_pointer_at_no_place_moves_nothing(
    table: Table, pointer: tuple[float, float, float]
) -> None:
    table.drag("start", (1.0, 1.0, 0.1))
    assert not table.page.takes(message("update", pointer))
    table.frames(5)
    assert table.moved == []


def test_a_drag_that_never_started_moves_nothing(table: Table) -> None:
    table.drag("update", (1.5, 1.0, 0.1))
    table.drag("end", (1.5, 1.0, 0.1))
    table.frames(5)
    assert table.moved == []


def test_a_page_that_has_not_said_where_its_camera_is_cannot_drag(
    table: Table, shared_server: ViewServer
) -> None:
    page = Upstream(shared_server, Session("operator 4", Role.OPERATOR))
    for phase in ("start", "update"):
        assert not page.takes(message(phase, toward((1.5, 1.0, 0.1))))
    table.frames(5)
    assert table.moved == []


def test_a_viewer_cannot_drag(table: Table, shared_server: ViewServer) -> None:
    page = Upstream(shared_server, Session("viewer 1", Role.VIEWER))
    assert page.takes(encode(CAMERA))
    for phase, x in (("start", 1.0), ("update", 1.5), ("end", 1.5)):
        assert not page.takes(message(phase, toward((x, 1.0, 0.1))))
    table.frames(5)
    assert table.moved == []


MALFORMED: list[dict[str, Any]] = [
    {"name": "/vehicle"},
    {"name": "/beacons/0/ball"},
    {"name": "/beacons/9/handle"},
    {"name": 3},
    {"name": None},
    {"phase": "begin"},
    {"phase": None},
    {"button": "right"},
    {"owner": "client 1"},
    {"end_position": [0.0, 0.0]},
    {"end_position": [0.0, 0.0, 0.0, 0.0]},
    {"end_position": ["0", "0", "0"]},
    {"end_position": None},
    {"end_position": [math.nan, 0.0, 0.0]},
    {"type": "SceneNodeClickMessage"},
]


@pytest.mark.parametrize("wrong", MALFORMED, ids=str)
def test_a_drag_that_is_none_goes_nowhere(
    table: Table, shared_server: ViewServer, wrong: dict[str, Any]
) -> None:
    came: list[Drag] = []
    shared_server.offer([HANDLE], came.append)
    assert not table.page.takes(message("start", (0.0, 0.0, 0.0)))
    assert len(came) == 1, "the sound one does come"
    sound = msgspec.msgpack.decode(message("start", (0.0, 0.0, 0.0)))
    assert not table.page.takes(encode({**sound, **wrong}))
    assert len(came) == 1


@pytest.mark.parametrize("role", list(Role))
@pytest.mark.parametrize("phase", ["start", "update", "end"])
def test_no_drag_reaches_viser_itself(shared_server: ViewServer, role: Role, phase: str) -> None:
    page = Upstream(shared_server, Session("somebody", role))
    assert page.takes(encode(CAMERA))
    assert not page.takes(message(phase, (0.0, 0.0, 0.0)))


def test_a_drag_too_long_to_be_one_ends_the_connection(table: Table) -> None:
    sound = msgspec.msgpack.decode(message("start", (0.0, 0.0, 0.0)))
    with pytest.raises(HostileError, match="bytes"):
        table.page.takes(encode({**sound, "padding": "x" * 5000}))


@pytest.mark.parametrize("frame", [b"", b"\xc1", b"text", encode(3), encode({"type": 1})])
def test_what_is_no_message_is_no_drag(frame: bytes) -> None:
    assert drag_of(frame, frozenset({HANDLE}), EYE, "operator 1") is None


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ([1.0, 2.0, 3.0], (1.0, 2.0, 3.0)),
        ([1, 2, 3], (1.0, 2.0, 3.0)),
        ([1.0, 2.0], None),
        ([math.nan, 0.0, 0.0], None),
        ("here", None),
        (None, None),
    ],
)
def test_a_camera_is_where_its_message_says(position: Any, expected: Any) -> None:
    assert eye_of(position) == expected


@pytest.fixture
def drags() -> BeaconDrags:
    return BeaconDrags()


def test_two_beacons_may_be_dragged_at_once(drags: BeaconDrags) -> None:
    moved: dict[int, str] = {}
    drags.on_moved = lambda id, _, who: moved.update({id: who})
    up = (0.0, 0.0, 1.0)
    for id, who in ((1, "operator 1"), (2, "operator 2")):
        drags.take(Drag("", "start", toward((0.0, 0.0, 0.0)), EYE, who), id, (0.0,) * 3, up, 1.0)
        drags.take(Drag("", "update", toward((0.3, 0.0, 0.0)), EYE, who), id, (0.0,) * 3, up, 1.1)
    drags.pass_on(1.1)
    assert moved == {1: "operator 1", 2: "operator 2"}


def test_a_beacon_that_is_gone_is_not_wanted_any_more(drags: BeaconDrags) -> None:
    up = (0.0, 0.0, 1.0)
    for phase, x in (("start", 0.0), ("update", 0.3)):
        pointer = toward((x, 0.0, 0.0))
        drags.take(Drag("", phase, pointer, EYE, "a"), 7, (0.0, 0.0, 0.0), up, 1.0)  # type: ignore[arg-type]
    places = {7: (0.0, 0.0, 0.0)}
    assert drags.wanted(places, 1.0)[7] == pytest.approx((0.3, 0.0, 0.0))
    drags.pass_on(1.0)
    assert drags.wanted({}, 1.0) == {}
    assert drags.wanted(places, 1.0) == {}
