"""A signed link opens one file, to be read, for ten minutes; any other use is refused."""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest

from quadrotor.errors import StorageError
from web.access.signed_links import AGE, KEY, SignedLinks

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


def changed(url: str, name: str) -> str:
    path, query = url.split("?")
    fields = dict(pair.split("=") for pair in query.split("&"))
    signature, expires = fields["signature"], fields["expires"]
    return {
        "none": path,
        "no signature": f"{path}?expires={expires}",
        "no time": f"{path}?signature={signature}",
        "forged": f"{path}?expires={expires}&signature={signature[::-1]}",
        "empty": f"{path}?expires={expires}&signature=",
        "not ASCII": f"{path}?expires={expires}&signature=%C3%A9%FF",
        "longer": f"{path}?expires={int(expires) + 60}&signature={signature}",
        "time no number": f"{path}?expires=never&signature={signature}",
        "twice": f"{url}&signature={signature}",
        "more": f"{url}&token=x",
        "other run": url.replace(RUN, "elsewhere"),
        "traversal": url.replace(f"{RUN}.mcap", f"..%2f..%2fruns%2f{RUN}.mcap"),
        "out of the folder": url.replace(f"{RUN}.mcap", "..%2fweb%2fdoor.json"),
        "other route": url.replace(f"/signed/runs/{RUN}.mcap", f"/api/runs/{RUN}/download"),
        "the page": url.replace(f"/signed/runs/{RUN}.mcap", "/api/runs"),
        "deeper": url.replace(f"{RUN}.mcap", f"{RUN}.mcap/notes"),
        "no ending": url.replace(".mcap", ""),
    }[name]


@pytest.mark.parametrize(
    "name",
    [
        "none",
        "no signature",
        "no time",
        "forged",
        "empty",
        "not ASCII",
        "longer",
        "time no number",
        "twice",
        "more",
        "other run",
        "traversal",
        "out of the folder",
        "other route",
        "the page",
        "deeper",
        "no ending",
    ],
)
def test_a_link_that_was_changed_opens_nothing(
    stranger: httpx.Client, link: dict[str, Any], name: str
) -> None:
    answer = stranger.get(changed(link["url"], name), headers={"Origin": FOXGLOVE})
    assert answer.status_code == 401, answer.text
    assert "access-control-allow-origin" not in answer.headers


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH"])
def test_a_link_only_reads(stranger: httpx.Client, link: dict[str, Any], method: str) -> None:
    assert stranger.request(method, link["url"]).status_code == 401


def scope(url: str, method: str = "GET") -> dict[str, Any]:
    path, query = url.split("?")
    return {"type": "http", "method": method, "path": path, "query_string": query.encode()}


@pytest.fixture
def clock() -> list[float]:
    return [1000.0]


@pytest.fixture
def links(tmp_path: Path, clock: list[float]) -> SignedLinks:
    return SignedLinks(tmp_path, lambda: clock[0])


def test_a_link_ends_after_ten_minutes(links: SignedLinks, clock: list[float]) -> None:
    url = links.make("r1")
    clock[0] += AGE
    assert links.opens(scope(url))
    clock[0] += 1.0
    assert not links.opens(scope(url))
    assert not links.opens(scope(url, "OPTIONS"))


def test_the_key_is_the_owners_alone_and_another_key_opens_nothing(
    tmp_path: Path, links: SignedLinks
) -> None:
    url = links.make("r1")
    assert stat.S_IMODE((tmp_path / KEY).stat().st_mode) == 0o600
    assert SignedLinks(tmp_path, lambda: 1000.0).opens(scope(url)), "of the same data folder"
    assert not SignedLinks(tmp_path / "other", lambda: 1000.0).opens(scope(url))


def test_a_damaged_key_is_said_and_never_used(tmp_path: Path) -> None:
    (tmp_path / KEY).write_bytes(b"short")
    with pytest.raises(StorageError, match="damaged; delete it"):
        SignedLinks(tmp_path)


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
