"""`quadlab web`: one port with the page, the API and the 3D view behind one sign-in."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import time
import webbrowser
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import uvicorn
from starlette.types import ASGIApp

from vehicle_link.defects import STATUS
from web.access.tls import Tls, own_names, shown_host
from web.assembly import assemble
from web.latest import Live
from web.live.connections import BoundedConnection, BoundedListener
from web.live.deafness import Deafness
from web.live.events import EventHub
from web.live.sockets import LiveWebSocket, listen
from web.live.station import Reactions, Station

if TYPE_CHECKING:
    from vehicle_link.transport.loopback import SharedSession

NICENESS = 5  # while it serves: display comes after flying, and after other programs
CLOSING_TIME = 2  # s for open downloads and sockets to end at shutdown
CHECK_PERIOD = 0.25
"""Period, in s, in which the station is asked whether it has made its start-up checks."""
WAITING_PERIOD = 1.5
"""Period, in s, of the lines printed while the sign-in link waits for them."""
LONGEST = 5.0
"""Longest time, in s, for which it waits; a first start compiles the vehicle for longer."""


def run_web(
    data: Path,
    port: int = 8080,
    loopback_port: int = 7447,
    token: str | None = None,
    vehicles: Sequence[str] = ("quad1",),
    host: str = "127.0.0.1",
    open_browser: bool = False,
    tls: Tls | None = None,
) -> None:
    """Serve the page until SIGINT or SIGTERM; to be called in the main thread.

    Args:
        data: the data folder; sign-in tokens are in `web/`, recorded runs in `runs/`.
        port: 0 chooses any free one.
        vehicles: names of the vehicles; the first one's page is at /, each one's at /v/NAME/.
        loopback_port: port of the station's router.
        token: a first sign-in token chosen by the caller; one is made if None.
        host: where to listen; `web.access.listen_address` checks whether that is allowed.
        tls: serve https with this certificate.
        open_browser: open the page in a browser, unless `token` was used before: then this is
            a restart, and the page is open already.

    Raises LinkError (port in use), UsageError (no such port) or StorageError (data folder).
    """
    from console.catalogue.catalogue import Catalogue
    from vehicle_link.defects import end_at_defect
    from vehicle_link.transport.loopback import SharedSession, loopback_session

    end_at_defect()
    stations = _Stations(SharedSession(lambda: loopback_session(loopback_port)))

    def show_link(url: str, signed_in: str | None = None) -> None:
        if signed_in is None:
            give_way()
            deafness = Deafness([live for live, _ in stations.made], loopback_port, end_deaf)
            Thread(target=deafness.run, name="deafness", daemon=True).start()
        is_first = token is not None and url.endswith(token)
        if is_first:  # wait until others have printed
            Thread(target=print_settled, args=(url, stations.made), daemon=True).start()
        else:
            print_link(url, signed_in)
        if open_browser and signed_in is None and (is_first or token is None):
            webbrowser.open(url)

    listener = listen(host, port)
    base_url = url_of(host, listener.getsockname()[1], has_tls=tls is not None)
    try:
        app = assemble(
            data=data,
            base_url=base_url,
            vehicles=vehicles,
            token=token,
            connect=stations.connect,
            catalogue=Catalogue(data),
            show_link=show_link,
            names=(*own_names(host), *(tls.names if tls else ())),
            tls=tls,
        )
        # uvicorn shuts down in order at SIGTERM and SIGINT and then raises them again.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
        with contextlib.suppress(KeyboardInterrupt):
            server(app, listener, tls).run(sockets=[listener])
    finally:
        listener.close()


class _Stations:
    """The clients of the station, one for each vehicle, which share a session."""

    def __init__(self, session: SharedSession) -> None:
        self.made: list[tuple[Live, Station]] = []
        self._session = session

    def connect(self, vehicle: str, live: Live, hub: EventHub, reactions: Reactions) -> Station:
        """Return the client of a vehicle's station."""
        shared = self._session
        station = Station(shared.open, vehicle, live, hub, reactions, lambda _: shared.close())
        self.made.append((live, station))
        return station


def end_deaf() -> None:
    """End this process as if it was killed: its threads do not answer any more."""
    print("quadlab web hears nothing from the station any more; it ends", flush=True)
    os._exit(STATUS)


def give_way() -> None:
    """Lower the priority of this process: of its threads, and of its session where one counts."""
    for thread in os.listdir("/proc/self/task"):
        with contextlib.suppress(OSError):  # it has ended, or had a higher niceness
            os.setpriority(os.PRIO_PROCESS, int(thread), NICENESS)
    with contextlib.suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICENESS))


def url_of(host: str, port: int, *, has_tls: bool) -> str:
    shown = shown_host(host)
    bracketed = f"[{shown}]" if ":" in shown else shown
    return f"{'https' if has_tls else 'http'}://{bracketed}:{port}"


def server(app: ASGIApp, listener: BoundedListener, tls: Tls | None = None) -> uvicorn.Server:
    """Return the uvicorn server with its settings: small buffers, no compression, only warnings.

    A proxy's headers are not trusted: any process on this computer could name any address in them,
    and wrong passwords are counted by address.
    """
    config = uvicorn.Config(
        app,
        http=partial(BoundedConnection, listener=listener),  # type: ignore[arg-type]
        ws=LiveWebSocket,
        ws_per_message_deflate=False,
        ws_max_size=64 * 1024,
        ws_ping_interval=5,  # a client that vanished must not keep control for long
        ws_ping_timeout=10,
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=CLOSING_TIME,
        lifespan="on",
        proxy_headers=False,
        ssl_certfile=tls.certificate if tls else None,
        ssl_keyfile=tls.key if tls else None,
    )
    return uvicorn.Server(config)


def print_settled(
    url: str, stations: Sequence[tuple[Live, Station]], longest: float = LONGEST
) -> None:
    """Print the sign-in link once all vehicles are connected and the start-up checks are made.

    Until then, for `longest` s at most, a line every WAITING_PERIOD reports what is missing. After
    that time the link is printed with a line that says what the page still waits for.
    """
    began = time.monotonic()
    printed = began - WAITING_PERIOD
    while (now := time.monotonic()) - began < longest:
        is_connected = all(live.current("status") is not None for live, _ in stations)
        if is_connected and all(station.has_checked() for _, station in stations):
            break
        if now - printed >= WAITING_PERIOD:
            printed = now
            what = "running the start-up checks" if is_connected else "waiting for the vehicle"
            print(f"quadlab: {what}, {now - began:.0f} s", flush=True)
        time.sleep(CHECK_PERIOD)
    else:
        print("quadlab: the vehicle still starts (compiled the first time)", flush=True)
    print(flush=True)
    print_link(url)


def print_link(url: str, signed_in: str | None = None) -> None:
    """Print the sign-in link, as Jupyter does; `signed_in` is who used the previous one."""
    if signed_in is None:
        print(f"quadlab is at  {url}", flush=True)
    else:
        print(f"{signed_in} signed in; for another browser:  {url}", flush=True)
