"""Puts the web process together: every part once, wired, with its loops started and stopped."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Collection
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from fastapi import FastAPI
from starlette.types import ASGIApp

from console.catalogue import Catalogue
from console.parameter_history import ParameterHistory
from console.parameter_presets import ParameterPresets
from vehicle_link.messages import decode
from web.access.attempts import Attempts
from web.access.gate import Gate
from web.access.passwords import Passwords
from web.access.people import open_people
from web.access.signed_links import SignedLinks
from web.access.tls import Tls
from web.app import create_app
from web.control import Control
from web.emergency import EmergencyDesk
from web.events import EventHub
from web.follow_parameters import ParameterFollower
from web.live import Live
from web.parameter_mirror import ParameterMirror
from web.parameters import GainPath
from web.parts import Parts
from web.runs.exports import ViserExports
from web.runs.report_making import ReportMaking
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
    names: Collection[str] = (),
    tls: Tls | None = None,
    attempts: Attempts | None = None,
    passwords: Passwords | None = None,
) -> ASGIApp:
    """The whole application behind its gate; stops `view_server` at its end.

    Args:
        base_url: where the page is; under https the cookie is Secure.
        connect: makes the station's client.
        names: of hosts that mean us, beside that of `base_url` and loopback's.
        tls: the page's certificate, to be looked at by the start-up checks.
        attempts, passwords: other than usual, for tests.

    Raises StorageError.
    """
    live, hub = Live(decode), EventHub()
    people = open_people(
        data / "web",
        base_url,
        token,
        say=hub.say,
        on_link=lambda label: show_link(sign_in_link(), label),
        attempts=attempts,
        passwords=passwords,
    )
    links, exports, reports = SignedLinks(data / "web"), ViserExports(), ReportMaking()
    mirror = ParameterMirror(hub.publish)
    scene = Scene(view_server, live)
    station = connect(live, hub)
    follower = ParameterFollower(mirror, station, live, scene, f"/{vehicle}")
    station.on_change = follower.changed_from_thread
    stick = StickOutput(station.publish_stick)
    station.on_stick_answer = stick.answer_from_thread
    feed = TelemetryFeed(live)
    control = Control(live, lambda: people.sockets.labels, station.publish_presence)

    def airborne() -> bool:
        status = live.current("status")
        return status is not None and bool(status.airborne)

    def sign_in_link() -> str:
        return f"{base_url}/?token={people.door.token}"

    @contextlib.asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        loop = asyncio.get_running_loop()
        hub.attach(loop)
        follower.attach(loop)
        stick.attach(loop)
        station.start()
        loops = [
            _start(part, hub) for part in (scene, feed, follower, people, people.sockets, control)
        ]
        show_link(sign_in_link())
        try:
            yield
        finally:
            for task in loops:
                task.cancel()
            await asyncio.gather(*loops, return_exceptions=True)
            station.stop()
            view_server.stop()
            exports.stop()
            reports.stop()
            people.stop()

    app = create_app(
        Parts(
            vehicle=vehicle,
            base_url=base_url,
            people=people,
            live=live,
            hub=hub,
            feed=feed,
            view_server=view_server,
            scene=scene,
            station=station,
            mirror=mirror,
            gains=GainPath(mirror, station, airborne),
            history=ParameterHistory(catalogue.engine, vehicle),
            presets=ParameterPresets(catalogue.engine, vehicle),
            catalogue=catalogue,
            tls=tls,
            links=links,
            exports=exports,
            reports=reports,
            stick=stick,
            emergency=EmergencyDesk(
                station,
                live,
                hub.publish,
                hub.say,
                chosen=lambda: mirror.value("safety.emergency_land"),
            ),
            control=control,
        ),
        lifespan,
    )
    return Gate(
        app,
        base_url=base_url,
        hosts=allowed_hosts(base_url, names),
        door=people.door,
        cookie=people.cookie,
        accounts=people.accounts,
        sign_in=people.sign_in,
        sockets=people.sockets,
        links=links,
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


def allowed_hosts(base_url: str, names: Collection[str] = ()) -> frozenset[str]:
    """Values of the Host header that mean us; others are a foreign name pointed at us."""
    place = urlsplit(base_url)
    port = place.port
    hosts = {place.hostname or "", "127.0.0.1", "localhost", "::1", *names}
    bracketed = {f"[{host}]" if ":" in host else host.lower() for host in hosts}
    found = {f"{host}:{port}" for host in bracketed}
    if port == {"https": 443, "http": 80}[place.scheme]:
        found |= bracketed  # browsers leave the scheme's own port out
    return frozenset(found)
