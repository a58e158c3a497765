"""Proxy of viser's page and websocket through the page's own port.

It passes viser's frames to the browser unchanged, and only camera messages back. The scene has no
viser widgets, and other messages let a client change what everyone sees (set attributes of handles,
drag nodes, request a public tunnel). An operator's drag of a handle, or click beside one, does not
reach viser either: it is passed to the receiver that `ViewServer` has for it.

Messages that viser's own client never sends to this scene (of other types, large ones) come from
another program: that connection is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from functools import cache
from importlib.metadata import distribution
from pathlib import Path

import msgspec
import websockets.asyncio.client
from fastapi import WebSocket
from starlette.websockets import WebSocketDisconnect
from websockets.exceptions import ConnectionClosed, WebSocketException

from web.access.roles import Role, Session
from web.live.sockets import POLICY_VIOLATION
from web.theme import TOKENS
from web.view.drag import click_of, drag_of
from web.view.server import SECRET_HEADER, VIEW_HEADER, ViewServer
from web.view.shapes import Point

CAMERA = "ViewerCameraMessage"
IDLE = ("SceneNodeDragMessage", "SceneNodeClickMessage", "ScenePointerMessage")
"""Messages that a pointer in viser's client may cause; none of them reaches viser."""
LARGEST_UPWARD = 4096  # bytes; a camera message is about 300
CLOSING = 0.5
"""Longest time, in s, for viser to answer a close frame, which waits behind unread frames."""
CLIENT_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "worker-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self' data: blob:; frame-ancestors 'self'"
)
"""Content policy of viser's client.

The client is one file with inline scripts, workers and WebAssembly; it may only connect to this
server.
"""

_INJECTION = f"""<script>document.hasFocus=()=>true
addEventListener("pointerdown",e=>{{
if(e.pointerType==="touch")e.target.releasePointerCapture(e.pointerId)}},true)
for(const{{prototype:gl}}of[WebGLRenderingContext,WebGL2RenderingContext]){{
const get=gl.getExtension;gl.getExtension=function(n){{
return n==="WEBGL_debug_renderer_info"?null:get.call(this,n)}}}}
if(new URLSearchParams(location.search).has("plain")){{
const{{prototype:canvas}}=HTMLCanvasElement,make=canvas.getContext
canvas.getContext=function(kind,of){{
return make.call(this,kind,{{...of,antialias:false}})}}}}</script>
<style>{TOKENS}html,body,div:has([data-dock-root]),canvas[data-engine]{{background:var(--ground)!important}}
[data-floating-window],.mantine-Paper-root[style*="position: fixed"]{{display:none!important}}
.mantine-Notifications-root{{inset:44px auto auto 12px!important;max-width:min(340px,100%)}}
.mantine-Notification-root{{background:var(--raised)!important;border:1px solid!important}}
.mantine-Notification-root *{{color:var(--text)!important}}
@media(max-width:700px){{.mantine-Notification-description{{display:none}}}}</style>
"""
"""Script and style added to viser's client, before all of its own: it is dark from its first frame.

The client reconnects only while its document has the focus, which an iframe does not have. It may
not learn the renderer's name, so that the page alone tells of software rendering. Its control panel
(server address, scene tree) is hidden. Browsers capture a finger for the element that it touches;
the client takes any capture for the drag of a handle, so that a tap would be no click.
"""


class _Upward(msgspec.Struct):
    """Head of a message that a browser sends to viser."""

    type: str
    position: object = None


_decode = msgspec.msgpack.Decoder(_Upward).decode


class HostileError(Exception):
    """Error of a message that viser's client does not send to this scene; the text describes it."""


def _read(frame: bytes | None) -> _Upward:
    if frame is None:
        raise HostileError("the view takes no text")
    if len(frame) > LARGEST_UPWARD:
        raise HostileError(f"{len(frame)} bytes; the view takes at most {LARGEST_UPWARD}")
    try:
        return _decode(frame)
    except (msgspec.DecodeError, RecursionError) as error:
        raise HostileError("this is not a message of viser") from error


class Upstream:
    """Filter of one browser's messages: it decides what reaches viser, and finds drags."""

    def __init__(self, server: ViewServer, session: Session) -> None:
        self._server = server
        self._session = session
        self._eye: Point | None = None

    def takes(self, frame: bytes | None) -> bool:
        """Return whether viser gets the message. Raises HostileError."""
        message = _read(frame)
        if message.type == CAMERA:
            self._eye = eye_of(message.position) or self._eye
            return True
        if message.type not in IDLE:
            raise HostileError(f"the view takes no {message.type[:40]}")
        if self._session.role.may(Role.OPERATOR) and frame is not None:
            self._use(frame, self._session.label)
        return False

    def _use(self, frame: bytes, who: str) -> None:
        takers, on_click = self._server.draggable, self._server.on_click
        drag = drag_of(frame, takers, self._eye, who) if takers else None
        if drag is not None:
            takers[drag.name](drag)
        elif on_click is not None and (click := click_of(frame, who)) is not None:
            on_click(click)


def eye_of(position: object) -> Point | None:
    """Return the camera's position in a camera message, m, world; None if it is not valid."""
    try:
        x, y, z = msgspec.convert(position, Point)
    except msgspec.ValidationError:
        return None
    return (x, y, z) if math.isfinite(x + y + z) else None


@cache
def client_html() -> bytes:
    """Return viser's single-file client with the additions, about 0.8 MB."""
    path = distribution("viser").locate_file("viser/client/build/index.html")
    html = Path(str(path)).read_text(encoding="utf-8")
    return html.replace("<head>", "<head>" + _INJECTION, 1).encode()


async def pump(socket: WebSocket, server: ViewServer, session: Session) -> None:
    """Pass one browser's view until either side closes."""
    offered = socket.scope.get("subprotocols", [])
    wanted = f"viser-v{server.version}"
    if wanted not in offered:
        await socket.close(1002, f"reload the page: the view is now {wanted}")
        return
    headers = {SECRET_HEADER: server.secret, VIEW_HEADER: socket.query_params.get("view", "")[:64]}
    try:
        upstream = await websockets.asyncio.client.connect(
            server.url,
            subprotocols=[websockets.Subprotocol(wanted)],
            additional_headers=headers,
            compression=None,
            max_size=None,
            max_queue=2,
            proxy=None,
            close_timeout=CLOSING,
        )
    except (OSError, WebSocketException):
        await socket.close(1013, "the 3D view is starting")
        return
    await socket.accept(subprotocol=wanted)
    try:
        async with asyncio.TaskGroup() as both:
            down = both.create_task(_down(upstream, socket))
            up = both.create_task(_up(socket, upstream, Upstream(server, session)))
            down.add_done_callback(lambda _: up.cancel())
            up.add_done_callback(lambda _: down.cancel())
    finally:
        await upstream.close()


async def _down(upstream: websockets.asyncio.client.ClientConnection, socket: WebSocket) -> None:
    with contextlib.suppress(ConnectionClosed, WebSocketDisconnect, OSError):
        async for frame in upstream:
            if isinstance(frame, bytes):
                await socket.send_bytes(frame)
        await socket.close(1012)


async def _up(
    socket: WebSocket, upstream: websockets.asyncio.client.ClientConnection, filtered: Upstream
) -> None:
    with contextlib.suppress(ConnectionClosed, WebSocketDisconnect, OSError):
        while (event := await socket.receive())["type"] != "websocket.disconnect":
            frame = event.get("bytes")
            try:
                if filtered.takes(frame) and frame is not None:
                    await upstream.send(frame)
            except HostileError as error:
                await socket.close(POLICY_VIOLATION, str(error))
                return
