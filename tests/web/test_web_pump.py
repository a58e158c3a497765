"""What may pass to viser, and that nobody reaches it but our pump."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import httpx
import msgspec
import pytest
import viser
import websockets
import websockets.exceptions
import websockets.sync.client
from viser import _messages

from web import pump
from web.access.roles import Role
from web.view_server import ViewServer

CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [1.0, 1.0, 1.0], "fov": 1.0, "near": 0.01,
    "far": 100.0, "image_height": 400, "image_width": 640, "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
VALUE = {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": 3.0}}
HARMFUL = [
    {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"update_cb": []}},
    {"type": "GuiUpdateMessage", "uuid": "u", "updates": {"value": 3.0, "disabled": False}},
    {"type": "GuiUpdateMessage", "uuid": "u"},
    {"type": "ShareUrlRequest"},
    {"type": "ShareUrlDisconnect"},
    {"type": "SceneNodeClickMessage", "name": "/vehicle"},
    {"type": "TransformControlsUpdateMessage", "name": "/vehicle"},
    {"type": "FileTransferStartUpload"},
    {"type": "RunJavascriptMessage", "source": "1"},
    {"type": "SetPositionMessage", "name": "/vehicle", "position": [0, 0, 9]},
]
encode = msgspec.msgpack.encode


@pytest.mark.parametrize("role", list(Role))
def test_everyone_may_move_their_camera(role: Role) -> None:
    assert pump.passes(encode(CAMERA), role)


def test_only_operators_may_set_the_value_of_a_widget() -> None:
    assert pump.passes(encode(VALUE), Role.OPERATOR)
    assert not pump.passes(encode(VALUE), Role.VIEWER)


@pytest.mark.parametrize("message", HARMFUL, ids=lambda m: m["type"])
@pytest.mark.parametrize("role", list(Role))
def test_nothing_else_passes(message: dict[str, Any], role: Role) -> None:
    assert not pump.passes(encode(message), role)


@pytest.mark.parametrize(
    "frame",
    [b"", b"\xc1", b"text", encode(3), encode({"type": 1}), encode({**CAMERA, "x": "y" * 5000})],
)
def test_what_is_no_message_does_not_pass(frame: bytes) -> None:
    assert not pump.passes(frame, Role.OPERATOR)


def test_the_client_page_is_told_that_it_has_the_focus() -> None:
    html = pump.client_html()
    head = html[: html.index(b"</head>")]
    assert b"document.hasFocus=()=>true" in head
    assert len(html) > 500_000


@pytest.fixture(scope="module")
def server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


def test_viser_answers_nobody_without_the_secret(server: ViewServer) -> None:
    url = f"http://127.0.0.1:{server.port}/"
    assert httpx.get(url).status_code == 403
    assert httpx.get(url, headers={"X-Quadlab-Secret": "wrong"}).status_code == 403
    with pytest.raises(websockets.exceptions.InvalidStatus) as caught:
        websockets.sync.client.connect(server.url, proxy=None)
    assert caught.value.response.status_code == 403


def test_viser_listens_on_loopback_only(server: ViewServer) -> None:
    assert server.viser.get_host() == "127.0.0.1"
    assert server.port not in (0, 8080)


def test_the_share_tunnel_is_refused(server: ViewServer) -> None:
    assert server.viser.request_share_url() is None
    handlers = server.viser._websock_server._incoming_handlers
    assert _messages.ShareUrlRequest not in handlers
    assert _messages.ShareUrlDisconnect not in handlers


def test_the_private_names_we_use_exist_in_this_viser(server: ViewServer) -> None:
    """A newer viser may rename them: then the version range in pyproject.toml must stop it."""
    inner = server.viser._websock_server
    assert isinstance(inner._live_connections, dict)
    assert isinstance(inner._incoming_handlers, dict)
    assert _messages.ViewerCameraMessage.__name__ == pump.CAMERA
    assert _messages.GuiUpdateMessage.__name__ == pump.WIDGET
    assert viser.__version__.startswith("1.1.")


def test_replacing_the_listener_lasts_only_for_the_start(server: ViewServer) -> None:
    import websockets.asyncio.server

    assert websockets.asyncio.server.serve.__module__.startswith("websockets")


def view(site: Any, cookie: str, name: str = "a") -> Any:
    return websockets.sync.client.connect(
        f"ws://{site.host}/viser?view={name}",
        additional_headers={"Cookie": cookie},
        origin=websockets.Origin(site.base),
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        compression=None,
        max_size=None,
        proxy=None,
    )


def test_the_scene_comes_through_the_pump(site: Any, operator: httpx.Client) -> None:
    with view(site, site.cookie(operator)) as socket:
        frame = socket.recv(timeout=10.0)
    assert isinstance(frame, bytes)
    assert len(frame) > 1000


def test_another_version_of_the_client_is_sent_away(site: Any, operator: httpx.Client) -> None:
    with pytest.raises(websockets.exceptions.InvalidStatus) as caught:
        site.websocket("/viser?view=a", site.cookie(operator))
    assert caught.value.response.status_code == 403


def test_only_the_camera_reaches_viser(
    site: Any, viewer: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    came: list[str] = []
    arrived = threading.Event()
    original = _messages.Message.deserialize.__func__  # type: ignore[attr-defined]

    def deserialize(cls: Any, raw: bytes) -> Any:
        message = original(cls, raw)
        came.append(type(message).__name__)
        arrived.set()
        return message

    monkeypatch.setattr(_messages.Message, "deserialize", classmethod(deserialize))
    with view(site, site.cookie(viewer)) as socket:
        socket.recv(timeout=10.0)
        for message in HARMFUL:
            socket.send(encode(message))
        socket.send("text")
        socket.send(encode(CAMERA))  # in order: the others were dropped when this one arrives
        assert arrived.wait(10.0)
    assert came == ["ViewerCameraMessage"]
