"""Puts the web process together: every part once, wired, with its loops started and stopped."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from fastapi import FastAPI
from starlette.types import ASGIApp

from bearing_sim.beacons import PAPER_BEACONS
from console.catalogue import Catalogue
from vehicle_link.messages import decode
from web.app import Parts, create_app
from web.door import Door
from web.events import EventHub
from web.follow_parameters import ParameterFollower
from web.gate import Gate
from web.live import Live
from web.parameters import GainPath, ParameterMirror
from web.scene import Scene
from web.station import Station
from web.sticks import StickOutput
from web.telemetry import TelemetryFeed
from web.view_server import ViewServer


class ShowLink(Protocol):
    def __call__(self, url: str, signed_in: str | None = None) -> None: ...


def assemble(
    *,
    data: Path,
    base_url: str,
    vehicle: str,
    token: str | None,
    connect: Callable[[Live, EventHub], Station],
    catalogue: Catalogue,
    show_link: ShowLink,
    view_server: ViewServer,
) -> ASGIApp:
    """The whole application behind its gate; stops `view_server` at its end.

    Args:
        connect: makes the station's client.

    Raises StorageError.
    """
    door = Door(data / "web", token)
    live, hub = Live(decode), EventHub()
    mirror = ParameterMirror(hub.publish)
    scene = Scene(view_server, live, PAPER_BEACONS.positions_w)
    station = connect(live, hub)
    follower = ParameterFollower(mirror, station, live, scene, f"/{vehicle}")
    station.on_change = follower.changed_from_thread
    feed = TelemetryFeed(live)

    def sign_in_link() -> str:
        return f"{base_url}/?token={door.token}"

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()
        hub.attach(loop)
        follower.attach(loop)
        station.start()
        loops = [_start(part, hub) for part in (scene, feed, follower)]
        show_link(sign_in_link())
        try:
            yield
        finally:
            for task in loops:
                task.cancel()
            await asyncio.gather(*loops, return_exceptions=True)
            station.stop()
            view_server.stop()

    app = create_app(
        Parts(
            vehicle=vehicle,
            base_url=base_url,
            door=door,
            live=live,
            hub=hub,
            feed=feed,
            view_server=view_server,
            scene=scene,
            station=station,
            mirror=mirror,
            gains=GainPath(mirror, station),
            catalogue=catalogue,
            stick=StickOutput(station.publish_stick),
        ),
        lifespan,
    )
    return Gate(
        app,
        door,
        hosts=allowed_hosts(base_url),
        cookie=f"quadlab_{urlsplit(base_url).port}",
        on_sign_in=lambda label: show_link(sign_in_link(), label),
    )


class _Runs(Protocol):
    async def run(self) -> None: ...


def _start(part: _Runs, hub: EventHub) -> asyncio.Task[None]:
    """A loop that ends by an error is a defect: told on the page, its trace in the terminal."""

    def ended(task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            name = type(part).__name__
            hub.say("error", f"{name} of quadlab web stopped ({error}); restart quadlab web")
            logging.getLogger("quadlab.web").error("%s stopped", name, exc_info=error)

    task = asyncio.create_task(part.run())
    task.add_done_callback(ended)
    return task


def allowed_hosts(base_url: str) -> frozenset[str]:
    """Values of the Host header that mean us; others are a foreign name pointed at us."""
    netloc = urlsplit(base_url).netloc
    port = urlsplit(base_url).port
    return frozenset({netloc, f"127.0.0.1:{port}", f"localhost:{port}", f"[::1]:{port}"})
