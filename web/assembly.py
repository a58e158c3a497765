"""Assembly of the web process: every part is made once, connected, started and stopped."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

from fastapi import FastAPI
from starlette.types import ASGIApp

from console.catalogue.catalogue import Catalogue
from quadrotor.extensions import registry
from web.access.gate import Gate
from web.access.passwords import Passwords
from web.access.people import open_people
from web.access.sign_in_limiter import SignInLimiter
from web.access.signed_links import SignedLinks
from web.access.tls import Tls
from web.app import PAGES, create_app
from web.feature import Feature
from web.features import built_in, documents_of_extensions, of_extensions, panels_of_extensions
from web.fleet.fleet import Fleet
from web.fleet.vehicle_router import VehicleRouter
from web.live.events import EventHub
from web.static_files import CachedFiles, files_with
from web.vehicle_context import Connect, Runs, SharedServices, VehicleContext
from web.view.server import ViewServer


class ShowLink(Protocol):
    def __call__(self, url: str, signed_in: str | None = None) -> None: ...


def assemble(
    *,
    data: Path,
    base_url: str,
    vehicles: Sequence[str],
    token: str | None,
    connect: Connect,
    catalogue: Catalogue,
    show_link: ShowLink,
    new_view_server: Callable[[], ViewServer] = ViewServer,
    names: Collection[str] = (),
    tls: Tls | None = None,
    limiter: SignInLimiter | None = None,
    passwords: Passwords | None = None,
) -> ASGIApp:
    """Assemble the whole application behind its gate.

    Args:
        base_url: the address of the page; under https the cookie is Secure.
        vehicles: names of the vehicles; the first one's page is at /, each one's at /v/NAME/.
        connect: makes the client of the station for one vehicle.
        names: host names of this page, in addition to those of `base_url` and loopback.
        tls: the page's certificate, for the start-up checks.
        limiter, passwords: replacements for tests.

    Raises StorageError.
    """
    hubs: list[EventHub] = []
    say = partial(_say, hubs)
    people = open_people(
        data / "web",
        base_url,
        token,
        say=say,
        on_link=lambda label: show_link(_sign_in_link(shared), label),
        limiter=limiter,
        passwords=passwords,
    )
    shared = SharedServices(base_url, people, catalogue, SignedLinks(people.tokens.secret), tls)
    contexts = [
        VehicleContext(name, shared, connect, EventHub(hubs), new_view_server())
        for name in vehicles
    ]
    features, fleet = (*built_in(), *of_extensions(say)), Fleet(contexts)
    parts = _Parts(contexts, shared, fleet, features, say, show_link)
    files = _static_files(say)
    apps = {  # the first one's runs for all
        context.vehicle: create_app(context, fleet, features, parts.run if k == 0 else None, files)
        for k, context in enumerate(contexts)
    }
    hosts = allowed_hosts(base_url, names)
    router = VehicleRouter(apps)
    return Gate(router, base_url=base_url, hosts=hosts, people=people, links=shared.links)


@dataclass(frozen=True)
class _Parts:
    """Parts that are started and stopped with the application."""

    contexts: Sequence[VehicleContext]
    shared: SharedServices
    fleet: Fleet
    features: Sequence[Feature]
    say: Callable[[str, str], None]
    show_link: ShowLink

    @contextlib.asynccontextmanager
    async def run(self, _: FastAPI) -> AsyncIterator[None]:
        """Start everything and show the sign-in link; stop everything at the end."""
        people = self.shared.people
        loops = _start_all(self.contexts, (people, people.sockets, self.fleet), self.say)
        self.show_link(_sign_in_link(self.shared))
        try:
            yield
        finally:
            await _ended(loops)
            of_vehicles = [one.stop for one in self.contexts]
            of_features = [one.stop for one in self.features]
            for stop in (*of_vehicles, self.fleet.stop, *of_features, people.stop):
                stop()


def _sign_in_link(shared: SharedServices) -> str:
    return f"{shared.base_url}/?token={shared.people.tokens.token}"


def _say(hubs: Sequence[EventHub], level: str, text: str) -> None:
    """Tell the pages of all vehicles."""
    for hub in hubs:
        hub.say(level, text)


def _static_files(say: Callable[[str, str], None]) -> CachedFiles:
    """Return the page's files with those of extensions, and say which of these are left out."""
    taken = [place.split("/")[1] for place in PAGES]
    files = files_with(tuple(panels_of_extensions()), tuple(documents_of_extensions(taken)))
    for line in (*registry().problems, *files.problems):
        say("error", line)
    return files


def _start_all(
    contexts: Sequence[VehicleContext], shared: Sequence[Runs], say: Callable[[str, str], None]
) -> list[asyncio.Task[None]]:
    """Start the vehicles' stations, and the loops of all parts."""
    for context in contexts:
        context.hub.attach(asyncio.get_running_loop())
        context.station.start()
    loops = [_start(part, say) for part in shared]
    return loops + [_start(part, one.hub.say) for one in contexts for part in one.loops]


async def _ended(tasks: Sequence[asyncio.Task[None]]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


def _start(part: Runs, say: Callable[[str, str], None]) -> asyncio.Task[None]:
    """Start the loop of a part.

    A loop that ends with an error is a defect: it is reported on the page, with its trace in the
    terminal.
    """

    def ended(task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            name = type(part).__name__
            say("error", f"{name} of quadlab web stopped ({error}); restart quadlab web")
            logging.getLogger("quadlab.web").error("%s stopped", name, exc_info=error)

    task = asyncio.create_task(part.run())
    task.add_done_callback(ended)
    return task


def allowed_hosts(base_url: str, names: Collection[str] = ()) -> frozenset[str]:
    """Return the values of the Host header that are accepted.

    Any other is a foreign host name that resolves to this address.
    """
    place = urlsplit(base_url)
    port = place.port
    hosts = {place.hostname or "", "127.0.0.1", "localhost", "::1", *names}
    bracketed = {f"[{host}]" if ":" in host else host.lower() for host in hosts}
    found = {f"{host}:{port}" for host in bracketed}
    if port == {"https": 443, "http": 80}[place.scheme]:
        found |= bracketed  # browsers omit the scheme's default port
    return frozenset(found)
