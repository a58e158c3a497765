"""Server of viser behind the page's sign-in, on loopback and a random port.

viser has no login and no origin check, so its port must answer only this process: each connection
needs a secret header, checked before viser sees the request. Its sockets get small send buffers:
viser replaces an unsent value by the newer one, which only works while the unsent ones are still in
viser and not in the kernel (a stalled tab would replay half a minute).
"""

from __future__ import annotations

import contextlib
import http
import io
import secrets
import socket
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import viser
import websockets.asyncio.server
from viser import _messages
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from web.view.frames import share_frames
from web.view.wake import make_writes_safe

if TYPE_CHECKING:
    from web.view.drag import Click, Drag

SECRET_HEADER = "X-Quadlab-Secret"
VIEW_HEADER = "X-Quadlab-View"
SEND_BUFFER = 16 * 1024  # bytes, the kernel doubles it


class ViewServer:
    """Server of viser, which only the proxy can connect to.

    A connection needs `secret` in SECRET_HEADER; VIEW_HEADER names the page's view, so that
    `clients_of(view)` finds the cameras to move. Operators may drag the nodes in `draggable`, whose
    receivers are called with the drags; `on_click`, unless None, is called with their clicks beside
    them. Both are called on the event loop.
    """

    def __init__(self) -> None:
        self.draggable: dict[str, Callable[[Drag], None]] = {}
        self.on_click: Callable[[Click], None] | None = None
        self.secret = secrets.token_urlsafe(24)
        share_frames()
        make_writes_safe()
        with _guarded_listener(self.secret), contextlib.redirect_stdout(io.StringIO()):
            self.viser = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        self.port = self.viser.get_port()
        refuse_sharing(self.viser)
        self.viser.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    @property
    def version(self) -> str:
        return viser.__version__

    def clients_of(self, views: set[str]) -> dict[str, viser.ClientHandle]:
        """Return view name → client, for the views that are connected and have sent a camera."""
        connections = self.viser._websock_server._live_connections
        found = {}
        for client_id, client in self.viser.get_clients().items():
            connection = connections.get(client_id)
            request = connection.request if connection is not None else None
            view = request.headers.get(VIEW_HEADER) if request is not None else None
            if view in views:
                found[view] = client
        return found

    def offer(self, names: Iterable[str], take: Callable[[Drag], None]) -> None:
        """Let operators drag these nodes, in place of the receiver's previous nodes."""
        kept = {name: taker for name, taker in self.draggable.items() if taker != take}
        self.draggable = kept | dict.fromkeys(names, take)

    @property
    def watched(self) -> bool:
        return bool(self.viser._websock_server._live_connections)

    def stop(self) -> None:
        with contextlib.redirect_stdout(io.StringIO()):  # as above: it prints addresses
            self.viser.stop()


def refuse_sharing(server: viser.ViserServer) -> None:
    """Refuse any tunnel to a public host, which a client could request by message."""

    def refuse(*_: Any, **__: Any) -> None:
        return None

    server.request_share_url = refuse  # type: ignore[method-assign]
    handlers = server._websock_server._incoming_handlers
    handlers.pop(_messages.ShareUrlRequest, None)
    handlers.pop(_messages.ShareUrlDisconnect, None)


@contextlib.contextmanager
def _guarded_listener(secret: str) -> Iterator[None]:
    """Replace `websockets.asyncio.server.serve` by one with this module's socket and check.

    viser accepts neither a socket nor a request hook. It looks `serve` up in the module when it
    starts its thread, and returns once it listens, so the replacement lasts only that long.
    """
    original = websockets.asyncio.server.serve

    def serve(handler: Any, host: str, port: int, **options: Any) -> Any:
        inner = options.pop("process_request", None)

        def check(connection: Any, request: Request) -> Any:
            given = request.headers.get(SECRET_HEADER, "")
            if not secrets.compare_digest(given, secret):
                return Response(http.HTTPStatus.FORBIDDEN, "Forbidden", Headers(), b"")
            return inner(connection, request) if inner is not None else None

        listener = socket.create_server((host, port))
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)  # inherited
        return original(
            handler, sock=listener, process_request=check, write_limit=SEND_BUFFER, **options
        )

    websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = original  # type: ignore[misc]
