"""A signed link opens one file, to be read, for ten minutes; any other use is refused."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from web.access.signed_links import AGE, SignedLinks
from web.access.steady_time import SteadySigner

RUN = "20260131T093042Z_quad1"
LOG = bytes(range(256)) * 40
FOXGLOVE, LICHTBLICK = "https://app.foxglove.dev", "https://lichtblick-suite.github.io"


@pytest.fixture
def stranger(site: Any) -> Iterator[httpx.Client]:
    """Yield a client without a session, and so without its cookie."""
    with site.browser() as client:
        yield client


@pytest.fixture
def link(site: Any, viewer: httpx.Client) -> dict[str, Any]:
    answer = viewer.post(f"/api/runs/{RUN}/link")
    assert answer.status_code == 200
    made: dict[str, Any] = answer.json()
    return made


def test_a_link_opens_the_file_without_a_session(
    stranger: httpx.Client, link: dict[str, Any]
) -> None:
    assert stranger.get(link["url"]).content == LOG
    head = stranger.head(link["url"])
    assert (head.status_code, head.headers["content-length"]) == (200, str(len(LOG)))
    part = stranger.get(link["url"], headers={"Range": "bytes=10200-"})
    assert (part.status_code, part.content) == (206, LOG[10200:])
    assert part.headers["content-range"] == f"bytes 10200-10239/{len(LOG)}"


@pytest.mark.parametrize("origin", [FOXGLOVE, LICHTBLICK, "http://localhost:8080"])
def test_the_viewers_pages_may_read_it_and_see_that_ranges_work(
    stranger: httpx.Client, link: dict[str, Any], origin: str
) -> None:
    answer = stranger.get(link["url"], headers={"Origin": origin, "Range": "bytes=0-9"})
    assert answer.headers["access-control-allow-origin"] == origin
    assert answer.headers["vary"] == "Origin"
    assert answer.headers["accept-ranges"] == "bytes"
    exposed = answer.headers["access-control-expose-headers"]
    assert {"Accept-Ranges", "Content-Length", "Content-Range"} <= set(exposed.split(", "))
    asked = {
        "Origin": origin,
        "Access-Control-Request-Method": "GET",
        "Access-Control-Request-Headers": "range",
    }
    allowed = stranger.options(link["url"], headers=asked)
    assert allowed.status_code == 200
    assert "Range" in allowed.headers["access-control-allow-headers"].split(", ")
    assert allowed.headers["access-control-allow-methods"] == "GET, HEAD"


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "null",
        "https://app.foxglove.dev.evil.example",
        "http://localhost.evil.example",
        "http://app.foxglove.dev",
    ],
)
def test_no_other_page_may_read_it(
    stranger: httpx.Client, link: dict[str, Any], origin: str
) -> None:
    headers = {"Origin": origin, "Access-Control-Request-Method": "GET"}
    for answer in (
        stranger.get(link["url"], headers=headers),
        stranger.options(link["url"], headers=headers),
    ):
        assert "access-control-allow-origin" not in answer.headers
    assert stranger.options(link["url"], headers=headers).status_code == 400


def test_the_deep_links_carry_the_whole_link(link: dict[str, Any]) -> None:
    for name, place in (("foxglove", f"{FOXGLOVE}/~/view"), ("lichtblick", LICHTBLICK)):
        assert link["viewers"][name].startswith(place)
        query = parse_qs(urlsplit(link["viewers"][name]).query)
        assert query == {"ds": ["remote-file"], "ds.url": [link["url"]]}
    assert urlsplit(link["url"]).path.endswith(f"/{RUN}.mcap"), "by which they know what it is"


def test_a_run_that_is_not_there_has_no_link(viewer: httpx.Client) -> None:
    for name in ("unknown", "elsewhere", "..%2f..%2fweb%2fdoor.json"):
        assert viewer.post(f"/api/runs/{name}/link").status_code == 404


LINKED = f"/signed/runs/{RUN}.mcap"
CHANGES: dict[str, Callable[[str, str], str]] = {
    "none": lambda path, _: path,
    "forged": lambda path, signature: f"{path}?signature={signature[::-1]}",
    "empty": lambda path, _: f"{path}?signature=",
    "not ASCII": lambda path, _: f"{path}?signature=%C3%A9%FF",
    "no time": lambda path, signature: f"{path}?signature={signature.split('.')[1]}",
    "later": lambda path, signature: f"{path}?signature=z{signature[1:]}",
    "twice": lambda path, signature: f"{path}?signature={signature}&signature={signature}",
    "more": lambda path, signature: f"{path}?signature={signature}&token=x",
    "other run": lambda path, s: f"{path}?signature={s}".replace(RUN, "elsewhere"),
    "traversal": lambda path, s: f"{path}?signature={s}".replace(RUN, f"..%2f..%2fruns%2f{RUN}"),
    "out of the folder": lambda path, s: f"{path}?signature={s}".replace(
        f"{RUN}.mcap", "..%2fweb%2fdoor.json"
    ),
    "other route": lambda path, s: f"{path}?signature={s}".replace(
        LINKED, f"/api/runs/{RUN}/download"
    ),
    "the page": lambda path, s: f"{path}?signature={s}".replace(LINKED, "/api/runs"),
    "deeper": lambda path, s: f"{path}/notes?signature={s}",
    "no ending": lambda path, s: f"{path.removesuffix('.mcap')}?signature={s}",
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_link_that_was_changed_opens_nothing(
    stranger: httpx.Client, link: dict[str, Any], change: Callable[[str, str], str]
) -> None:
    answer = stranger.get(change(*link["url"].split("?signature=")), headers={"Origin": FOXGLOVE})
    assert answer.status_code == 401, answer.text
    assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH"])
def test_a_link_only_reads(stranger: httpx.Client, link: dict[str, Any], method: str) -> None:
    assert stranger.request(method, link["url"]).status_code == 401


def scope(url: str, method: str = "GET") -> dict[str, Any]:
    path, query = url.split("?")
    return {"type": "http", "method": method, "path": path, "query_string": query.encode()}


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [1000.0]
    monkeypatch.setattr(SteadySigner, "get_timestamp", lambda _: int(now[0]))
    return now


@pytest.fixture
def links(clock: list[float]) -> SignedLinks:
    return SignedLinks("a secret")


def test_a_link_ends_after_ten_minutes(links: SignedLinks, clock: list[float]) -> None:
    url = links.make("r1")
    clock[0] += AGE
    assert links.opens(scope(url))
    clock[0] += 1.0
    assert not links.opens(scope(url))
    assert not links.opens(scope(url, "OPTIONS"))


def test_another_secret_opens_nothing(links: SignedLinks) -> None:
    url = links.make("r1")
    assert SignedLinks("a secret").opens(scope(url)), "of the same data folder"
    assert not SignedLinks("another").opens(scope(url))


def test_a_websocket_is_never_opened_by_a_link(links: SignedLinks) -> None:
    assert not links.opens({**scope(links.make("r1")), "type": "websocket"})


def test_a_link_of_a_deleted_run_opens_nothing(
    site: Any,
    operator: httpx.Client,
    stranger: httpx.Client,
    link: dict[str, Any],
    until: Callable[..., None],
) -> None:
    assert operator.post("/api/trash", json={"runs": [RUN]}).json()["done"] == [RUN]
    try:
        assert stranger.get(link["url"]).status_code == 404
    finally:
        assert operator.post("/api/trash/restore", json={"runs": [RUN]}).json()["done"] == [RUN]
    assert stranger.get(link["url"]).content == LOG
