"""Routes while the base station is away or silent: answers with a kind, without machine words.

A command that was not answered in time (504) is distinguished from one that reached no station
(503) and from a refused one (409): the page decides by it whether to check what became of it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.loopback import loopback_session
from vehicle_link.transport.session import hub_session
from web.live import station as web_station
from web.live.sockets import listen
from web.live.station import Station

TOLD = ("error", "problem", "reason")
NOT_ASKED = ("/api/session/sign_out",)  # ends the session with which the others are called
NAMES = "|".join(name for name in SERVICES if "_" in name)
OF_MACHINES = re.compile(rf"/quad1|\bstation/|\b({NAMES})\b|/\w+/(station|vehicle|simulator)\b")


def sample(schema: dict[str, Any], schemas: dict[str, Any]) -> Any:
    """Return about the smallest value that a schema of /api/openapi.json allows."""
    if "$ref" in schema:
        return sample(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    if "anyOf" in schema:
        return sample(schema["anyOf"][0], schemas)
    if "enum" in schema or "const" in schema:
        return schema["const"] if "const" in schema else schema["enum"][0]
    match schema.get("type"):
        case "object":
            required = schema.get("required", ())
            return {name: sample(schema["properties"][name], schemas) for name in required}
        case "array":
            return []
        case "boolean":
            return True
        case "number" | "integer":
            return schema.get("minimum", 1)
        case _:
            return "x" * schema.get("minLength", 1)


def all_requests(browser: httpx.Client) -> Iterator[tuple[str, str, Any]]:
    """Yield method, path and body of a request to each route of the API."""
    description = browser.get("/api/openapi.json").json()
    schemas = description["components"]["schemas"]
    for path, methods in description["paths"].items():
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {})
            body = content.get("application/json", {}).get("schema")
            if path not in NOT_ASKED:
                filled = re.sub(r"\{[^}]*\}", "x", path)
                yield method, filled, None if body is None else sample(body, schemas)


def texts(content: Any) -> Iterator[str]:
    """Yield the texts with which an answer reports a failure to a person."""
    if isinstance(content, dict):
        for key, value in content.items():
            if key in TOLD and isinstance(value, str):
                yield value
            yield from texts(value)
    elif isinstance(content, list):
        for value in content:
            yield from texts(value)


@pytest.fixture
def router() -> Iterator[tuple[int, Any]]:
    """Yield port and session of the station's router, with no service behind it."""
    with listen("127.0.0.1", 0) as free:
        port = free.getsockname()[1]
    session = hub_session(port)
    yield port, session
    session.close()


@pytest.fixture
def admin(
    router: tuple[int, Any], serve: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, until: Any
) -> Iterator[httpx.Client]:
    monkeypatch.setattr(web_station, "CALL_TIMEOUT", 0.3)
    monkeypatch.setattr(web_station, "PATIENCE", {})
    port, _ = router
    opened: list[Any] = []

    def open_session() -> Any:
        opened.append(loopback_session(port))
        return opened[-1]

    data = tmp_path / "web"
    with serve(data, Catalogue(data), kind=Station, open_session=open_session) as site:
        until(lambda: site.station._node is not None)
        with site.sign_in() as client:
            yield client


def ask_all(admin: httpx.Client) -> dict[str, int]:
    """Return the status of each route; no text in them names a service."""
    statuses = {}
    for method, path, body in all_requests(admin):
        answer = admin.request(method, path, json=body)
        statuses[path] = answer.status_code
        if "json" not in answer.headers.get("content-type", ""):
            continue
        for text in texts(answer.json()):
            assert not OF_MACHINES.search(text), f"{method} {path}: {text}"
    return statuses


FLIGHT = [f"/api/commands/{name}" for name in ("arm", "disarm", "start_behavior", "emergency")]


def test_an_absent_station_is_one_that_nothing_reached(admin: httpx.Client) -> None:
    statuses = ask_all(admin)
    assert {statuses[path] for path in FLIGHT} == {503}


def test_a_silent_station_leaves_it_open_what_became_of_a_command(
    admin: httpx.Client, router: tuple[int, Any]
) -> None:
    held: list[Any] = []  # a query that is held is not answered
    queryable = router[1].declare_queryable("**", held.append, complete=True)
    try:
        statuses = ask_all(admin)
    finally:
        queryable.undeclare()
    assert {statuses[path] for path in FLIGHT} == {504}
    assert held
