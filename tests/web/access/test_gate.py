"""Nothing is served without a session, to a foreign origin or under a foreign name."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import re
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
import websockets.exceptions

from console.catalogue.catalogue import Catalogue
from web.body import LARGEST, LARGEST_JSON

READ = [
    "/",
    "/kill",
    "/static/console/app.js",
    "/vendor/uPlot.iife.js",
    "/viser/",
    "/api/session",
    "/api/signals",
    "/api/behaviors",
    "/api/summary",
    "/api/events",
    "/api/parameters",
    "/api/runs",
    "/api/openapi.json",
]
WRITE = [
    ("POST", "/api/commands/arm", {}),
    ("POST", "/api/commands/disarm", {}),
    ("POST", "/api/commands/start_behavior", {"name": "land"}),
    ("POST", "/api/commands/emergency", {"action": "cut"}),  # anyone may land
    ("POST", "/api/commands/record", {"start": True}),
    ("PUT", "/api/parameters", {"values": {"gains.kp": 5.0}}),
    ("POST", "/api/invitations", {}),
    ("PUT", "/api/runs/20260131T093042Z_quad1/notes", {"notes": ""}),
]
PAGE = {"Accept": "text/html,*/*"}
SOCKETS = ["/ws/telemetry", "/ws/events", "/ws/stick", "/viser?view=a"]


@pytest.fixture(scope="module")
def signed_in(site: Any) -> Iterator[httpx.Client]:
    with site.sign_in() as client:
        yield client


@pytest.mark.parametrize("path", READ)
def test_reading_needs_a_session(site: Any, signed_in: httpx.Client, path: str) -> None:
    with site.browser() as stranger:
        assert stranger.get(path).status_code == 401
        assert stranger.head(path).status_code == 401
    assert signed_in.get(path).status_code == 200


@pytest.mark.parametrize(("method", "path", "body"), WRITE)
def test_writing_needs_a_session(
    site: Any, station: Any, method: str, path: str, body: Any
) -> None:
    with site.browser() as stranger:
        answer = stranger.request(method, path, json=body)
    assert answer.status_code == 401
    assert "sign-in link" in answer.json()["error"]
    assert station.requests == []


@pytest.mark.parametrize(("method", "path", "body"), WRITE)
def test_a_foreign_origin_may_not_write(
    site: Any, signed_in: httpx.Client, station: Any, method: str, path: str, body: Any
) -> None:
    foreign = {"Origin": "http://evil.example"}
    answer = signed_in.request(method, path, json=body, headers=foreign)
    assert answer.status_code == 403
    assert "another site (http://evil.example)" in answer.json()["error"]
    assert station.requests == []


@pytest.mark.parametrize("origin", ["null", "http://localhost:1", "https://127.0.0.1"])
def test_other_spellings_of_a_foreign_origin_are_refused_too(
    signed_in: httpx.Client, origin: str
) -> None:
    answer = signed_in.post("/api/commands/arm", json={}, headers={"Origin": origin})
    assert answer.status_code == 403


def test_our_own_origin_and_a_program_without_one_may_write(
    site: Any, signed_in: httpx.Client, station: Any
) -> None:
    ours = signed_in.post("/api/commands/arm", json={}, headers={"Origin": site.base})
    assert ours.status_code == 200
    assert signed_in.post("/api/commands/arm", json={}).status_code == 200


@pytest.mark.parametrize("path", SOCKETS)
def test_a_websocket_needs_a_session(site: Any, path: str) -> None:
    with pytest.raises(websockets.exceptions.InvalidStatus) as caught:
        site.websocket(path, None)
    assert caught.value.response.status_code == 401


@pytest.mark.parametrize("path", SOCKETS)
def test_a_foreign_origin_gets_no_websocket(site: Any, signed_in: httpx.Client, path: str) -> None:
    with pytest.raises(websockets.exceptions.InvalidStatus) as caught:
        site.websocket(path, site.cookie(signed_in), "http://evil.example")
    assert caught.value.response.status_code == 403
    assert b"another site" in (caught.value.response.body or b"")


def test_a_foreign_host_name_is_refused(signed_in: httpx.Client) -> None:
    answer = signed_in.get("/api/session", headers={"Host": "evil.example"})
    assert answer.status_code == 403
    assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize(
    ("kind", "limit"), [("application/json", LARGEST_JSON), ("text/plain", LARGEST)]
)
def test_a_body_that_would_fill_the_memory_is_refused_before_it_is_read(
    site: Any, signed_in: httpx.Client, kind: str, limit: int
) -> None:
    def answer(**more: str) -> tuple[int, str]:
        """Send the head of a request alone."""
        cookie = "; ".join(f"{one.name}={one.value}" for one in signed_in.cookies.jar)
        connection = HTTPConnection(site.host, timeout=20)
        connection.putrequest("POST", "/api/figure")
        for name, value in {"Content-Type": kind, "Cookie": cookie, **more}.items():
            connection.putheader(name, value)
        connection.endheaders()
        with contextlib.closing(connection), connection.getresponse() as got:
            return got.status, json.loads(got.read())["error"]

    assert answer(**{"Content-Length": str(limit + 1)}) == (
        413,
        f"the request has {limit + 1} bytes; allowed are {limit}",
    )
    assert answer(**{"Transfer-Encoding": "chunked"})[0] == 411
    small = signed_in.post("/api/figure", content=b" ", headers={"Content-Type": kind})
    assert small.status_code not in (411, 413)


def test_localhost_is_our_name_too(site: Any, signed_in: httpx.Client) -> None:
    port = site.host.split(":")[1]
    answer = signed_in.get(
        "/api/session", headers={"Host": f"localhost:{port}", "Cookie": site.cookie(signed_in)}
    )
    assert answer.status_code == 200


def test_a_link_works_once_and_the_next_one_is_shown(site: Any) -> None:
    first = site.token
    with site.sign_in(first) as client:
        assert client.get("/api/session").json()["role"] == "admin"
    assert site.token != first
    with site.browser() as late:
        answer = late.get("/", params={"token": first})
        assert late.post("/login", data={"token": first}).status_code == 401
    assert answer.status_code == 401
    assert "has been used" in answer.text
    assert "terminal" in answer.text


def test_opening_a_link_signs_nobody_in_and_its_page_posts_the_token(site: Any) -> None:
    """A page of another site can make a browser open a link, but not post from here."""
    token = site.token
    with site.browser() as stranger:
        opened = stranger.get("/", params={"token": token}, headers=PAGE)
        assert (opened.status_code, dict(opened.cookies)) == (200, {})
        script = re.search(r"<script>(.*)</script>", opened.text)
        assert script is not None
        digest = base64.b64encode(hashlib.sha256(script[1].encode()).digest()).decode()
        policy = opened.headers["content-security-policy"]
        assert f"script-src 'sha256-{digest}'" in policy
        assert "frame-ancestors 'none'" in policy
        for headers in (
            {"Origin": "http://evil.example"},
            {"Origin": "null"},
            {"Sec-Fetch-Site": "cross-site"},
        ):
            answer = stranger.post("/login", data={"token": token}, headers=headers)
            assert (answer.status_code, dict(answer.cookies)) == (403, {})
        assert site.token == token
        ours = {**PAGE, "Origin": site.base, "Sec-Fetch-Site": "same-origin"}
        answer = stranger.post("/login", data={"token": token}, headers=ours)
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        assert stranger.get("/api/session").json()["role"] == "admin"


def test_a_link_of_another_role_asks_before_it_replaces_a_session(site: Any) -> None:
    with site.sign_in() as admin:
        label = admin.get("/api/session").json()["label"]
        url = admin.post("/api/invitations", json={"role": "viewer"}).json()["url"]
        token = parse_qs(urlsplit(url).query)["token"][0]
        asked = admin.post("/login", data={"token": token}, headers=PAGE)
        assert (asked.status_code, dict(asked.cookies)) == (200, {})
        assert f"You are signed in as {label}" in asked.text
        assert admin.post("/login", data={"token": token}).status_code == 409
        assert admin.get("/api/session").json()["label"] == label
        answer = admin.post("/login", data={"token": token, "replace": "1"})
        assert answer.json()["role"] == "viewer"
        assert admin.get("/api/session").json()["role"] == "viewer"


def test_a_wrong_link_says_what_to_do(site: Any) -> None:
    with site.browser() as stranger:
        answer = stranger.get("/", params={"token": "wrong"})
    assert answer.status_code == 401
    assert "no longer valid" in answer.text
    assert "Open the newest link" in answer.text
    assert not answer.cookies


def test_who_is_signed_in_does_not_consume_a_link(site: Any, signed_in: httpx.Client) -> None:
    token = site.token
    assert signed_in.get("/", params={"token": token}).status_code == 200
    with site.browser() as other:
        assert other.head("/", params={"token": token}).status_code == 401
    assert site.token == token
    site.sign_in(token).close()


def test_the_cookie_is_out_of_reach_of_scripts_and_other_sites(site: Any) -> None:
    with site.browser() as client:
        cookie = client.post("/login", data={"token": site.token}).headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert cookie.startswith(f"quadlab_{site.host.split(':')[1]}=")


def test_people_are_told_apart(site: Any) -> None:
    with site.sign_in() as one, site.sign_in() as two:
        labels = {c.get("/api/session").json()["label"] for c in (one, two)}
    assert len(labels) == 2


@pytest.mark.parametrize(("method", "path", "body"), WRITE)
def test_a_viewer_may_not_command(
    viewer: httpx.Client, station: Any, method: str, path: str, body: Any
) -> None:
    answer = viewer.request(method, path, json=body)
    assert answer.status_code == 403
    assert "may watch but not command" in answer.json()["error"]
    assert station.requests == []


def test_a_viewer_may_read_everything(viewer: httpx.Client) -> None:
    assert all(viewer.get(path).status_code == 200 for path in READ)


def test_a_restart_keeps_sessions_and_the_unused_link(tmp_path: Path, serve: Any) -> None:
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue) as before:
        client = before.sign_in()
        label = client.get("/api/session").json()["label"]
        ((name, value),) = client.cookies.items()
        client.close()
        unused = before.token
    with serve(tmp_path, catalogue) as after:
        assert after.token == unused
        # The port here is another, and with it the cookie's name; a real restart keeps its port.
        cookie = f"quadlab_{after.host.split(':')[1]}={value}"
        assert name != cookie.split("=", maxsplit=1)[0]
        answer = httpx.get(f"{after.base}/api/session", headers={"Cookie": cookie})
        assert answer.json()["label"] == label
        after.sign_in(unused).close()
    catalogue.close()


def test_pages_forbid_foreign_content(signed_in: httpx.Client) -> None:
    page = signed_in.get("/").headers
    assert "default-src 'self'" in page["content-security-policy"]
    assert page["x-content-type-options"] == "nosniff"
    view = signed_in.get("/viser/").headers["content-security-policy"]
    assert "connect-src 'self'" in view
    assert "http" not in view
