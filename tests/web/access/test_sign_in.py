"""Sign-in by name and password, sign-out, and management of users over the API."""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets.exceptions
from sqlalchemy import delete

from console.catalogue.catalogue import Catalogue
from web.access.accounts import Accounts
from web.access.database import AccessDatabase, AccountRow, SessionRow
from web.access.passwords import Passwords
from web.access.roles import Role
from web.access.sign_in import LARGEST_FORM
from web.access.sign_in_limiter import FORGOTTEN, FREE

WORDS = "correct horse battery"
OTHER = "another staple here"
PAGE = {"Accept": "text/html,*/*"}


@contextlib.contextmanager
def opened(data: Path, serve: Any) -> Iterator[Any]:
    catalogue = Catalogue(data)
    with serve(data, catalogue) as running:
        yield running
    catalogue.close()


@pytest.fixture(scope="module")
def shared_site(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    with opened(tmp_path_factory.mktemp("sign_in"), serve) as running:
        yield running


@pytest.fixture
def place(shared_site: Any) -> Any:
    """Return the site with anna (admin), oleg (operator) and vera (viewer), all signed out."""
    furnish(shared_site)
    return shared_site


def furnish(place: Any) -> None:
    database = AccessDatabase(place.data / "web")
    with database.session() as transaction:
        transaction.execute(delete(AccountRow))
        transaction.execute(delete(SessionRow))
    database.close()
    place.clock[0] += 2.0 * FORGOTTEN
    accounts = outside(place.data)
    for name, role in (("anna", Role.ADMIN), ("oleg", Role.OPERATOR), ("vera", Role.VIEWER)):
        accounts.add(name, role, WORDS)


def outside(data: Path) -> Accounts:
    """Return the accounts as another process sees them."""
    return Accounts(AccessDatabase(data / "web"), Passwords(1, 8))


def log_in(place: Any, name: str, password: str = WORDS, **headers: str) -> httpx.Response:
    with place.browser() as client:
        words = {"name": name, "password": password}
        answer: httpx.Response = client.post("/login", data=words, headers=headers)
        return answer


def browser_of(place: Any, name: str) -> httpx.Client:
    answer = log_in(place, name)
    assert answer.status_code == 200, answer.text
    client: httpx.Client = place.browser()
    client.cookies.update(answer.cookies)
    return client


def until_closed(socket: Any) -> int | None:
    """Return the close code, once the other end has sent it."""
    with contextlib.suppress(websockets.exceptions.ConnectionClosed):
        while True:
            socket.recv(timeout=20.0)
    code: int | None = socket.close_code
    return code


def lines(client: httpx.Client) -> list[str]:
    return [line["text"] for line in client.get("/api/events").json()]


@pytest.mark.parametrize(
    ("name", "role"), [("anna", "admin"), ("oleg", "operator"), (" Vera ", "viewer")]
)
def test_a_name_and_its_password_open_a_session_of_its_role(
    place: Any, name: str, role: str
) -> None:
    answer = log_in(place, name)
    assert answer.json() == {"label": name.strip().lower(), "role": role}
    cookie = answer.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert answer.headers["cache-control"] == "no-store"
    with browser_of(place, name) as client:
        session = client.get("/api/session").json()
    assert (session["label"], session["role"]) == (name.strip().lower(), role)
    assert session["account"] is True


def test_a_browsers_form_goes_on_to_the_page(place: Any) -> None:
    answer = log_in(place, "anna", **PAGE, Origin=place.base)
    assert answer.status_code == 303
    assert answer.headers["location"] == "/"
    assert answer.cookies


@pytest.mark.parametrize(("name", "password"), [("anna", OTHER), ("nobody", WORDS), ("", "")])
def test_what_is_wrong_is_not_said(place: Any, name: str, password: str) -> None:
    answer = log_in(place, name, password)
    assert answer.status_code == 401
    assert answer.json() == {"error": "The name or the password is wrong."}
    assert not answer.cookies


def test_the_form_comes_back_with_the_line_and_the_name_but_never_the_password(place: Any) -> None:
    answer = log_in(place, '"><script>', OTHER, **PAGE)
    assert answer.status_code == 401
    assert "The name or the password is wrong." in answer.text
    assert 'value="&quot;&gt;&lt;script&gt;"' in answer.text
    assert OTHER not in answer.text
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
    # Under `no-referrer` a browser would send the form with `Origin: null`.
    assert answer.headers["referrer-policy"] == "same-origin"


def test_without_accounts_no_password_is_asked_for(tmp_path: Path, serve: Any) -> None:
    with opened(tmp_path, serve) as running, running.browser() as client:
        assert 'name="password"' not in client.get("/", headers=PAGE).text
        outside(tmp_path).add("anna", None, WORDS)
        assert 'name="password"' in client.get("/login").text


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1"])
def test_a_foreign_page_cannot_sign_anyone_in(place: Any, origin: str) -> None:
    answer = log_in(place, "anna", Origin=origin)
    assert answer.status_code == 403
    assert not answer.cookies


def test_a_form_too_large_is_refused(place: Any) -> None:
    answer = log_in(place, "anna", "x" * (LARGEST_FORM + 1))
    assert answer.status_code == 400
    assert f"allowed are {LARGEST_FORM} bytes" in answer.json()["error"]


@pytest.mark.parametrize("body", [b"", b"\xff\xfe", b"name", b"name=a&" * 9, b"%%%=%"])
def test_what_is_no_form_signs_nobody_in(place: Any, body: bytes) -> None:
    with place.browser() as client:
        answer = client.post("/login", content=body)
    assert answer.status_code in (400, 401)
    assert "\n" not in answer.json()["error"]


def test_other_methods_are_told_which_to_use(place: Any) -> None:
    with place.browser() as client:
        answer = client.put("/login", content=b"")
    assert answer.status_code == 405
    assert "POST" in answer.headers["allow"]


def test_after_five_failures_one_waits_and_a_success_resets(place: Any) -> None:
    for _ in range(FREE):
        assert log_in(place, "anna", OTHER).status_code == 401
    refused = log_in(place, "anna")
    assert refused.status_code == 429, "the right password does not help meanwhile"
    assert refused.headers["retry-after"] == "2"
    assert refused.json()["error"] == "Too many wrong sign-ins; wait 2 s, then try again."
    assert "wait 2 s" in log_in(place, "anna", **PAGE).text
    place.clock[0] += 2.0
    assert log_in(place, "anna").status_code == 200
    for _ in range(FREE):
        assert log_in(place, "anna", OTHER).status_code == 401


def test_a_header_does_not_change_whose_attempts_are_counted(place: Any) -> None:
    for k in range(FREE):
        forged = {"X-Forwarded-For": f"192.0.2.{k}"}
        assert log_in(place, f"name{k}", OTHER, **forged).status_code == 401
    assert log_in(place, "anna", **{"X-Forwarded-For": "192.0.2.99"}).status_code == 429


@pytest.fixture
def fresh_site(tmp_path: Path, serve: Any) -> Iterator[Any]:
    with opened(tmp_path, serve) as running:
        furnish(running)
        yield running


def test_every_sign_in_is_told_and_no_password_is(
    fresh_site: Any, caplog: pytest.LogCaptureFixture
) -> None:
    place = fresh_site
    caplog.set_level(logging.INFO, "quadlab.web")
    log_in(place, "anna", OTHER)
    log_in(place, OTHER, "typed in the wrong field")
    with place.browser() as stranger:
        stranger.get("/", params={"token": "wrong"})
    with browser_of(place, "anna") as client, place.sign_in() as by_link:
        told = lines(client)
        by_link.post("/api/session/sign_out", json={})
        told += lines(client)[len(told) :]
    assert "sign-in refused: the password of anna, from 127.0.0.1" in told
    assert "sign-in refused: a name that is not known, from 127.0.0.1" in told
    assert "a sign-in link that was wrong came from 127.0.0.1" in told
    assert "anna (admin) signed in from 127.0.0.1" in told
    assert "admin 1 signed in by a link from 127.0.0.1" in told
    assert "admin 1 signed out" in told
    assert set(told) <= {record.getMessage() for record in caplog.records}
    for text in told + [record.getMessage() for record in caplog.records]:
        assert OTHER not in text
        assert WORDS not in text


def test_signing_out_ends_the_session_for_good(tmp_path: Path, serve: Any) -> None:
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue) as before:
        port = int(before.host.split(":")[1])
        with before.sign_in() as client, before.sign_in() as other:
            kept, ended = before.cookie(other), before.cookie(client)
            answer = client.post("/api/session/sign_out", json={})
            assert "Max-Age=0" in answer.headers["set-cookie"]
            assert before.base
    with serve(tmp_path, catalogue, port=port) as after:
        url = f"{after.base}/api/session"
        assert httpx.get(url, headers={"Cookie": ended}).status_code == 401
        assert httpx.get(url, headers={"Cookie": kept}).status_code == 200
    catalogue.close()


@pytest.mark.parametrize("path", ["/ws/events", "/ws/telemetry", "/ws/stick"])
@pytest.mark.parametrize("how", ["sign out", "another process"])
def test_open_websockets_of_an_ended_session_are_closed(place: Any, path: str, how: str) -> None:
    with (
        browser_of(place, "oleg") as client,
        place.websocket(path, place.cookie(client)) as socket,
        browser_of(place, "anna") as other,
        place.websocket("/ws/events", place.cookie(other)) as kept,
    ):
        if how == "sign out":
            client.post("/api/session/sign_out", json={})
        else:
            outside(place.data).set_role("oleg", Role.VIEWER)
        assert until_closed(socket) == 4401
        assert json.loads(kept.recv(timeout=20.0))["type"] == "hello"
        assert other.get("/api/session").status_code == 200


def test_sticks_of_an_ended_session_are_released(place: Any, until: Any) -> None:
    with (
        browser_of(place, "oleg") as client,
        place.websocket("/ws/stick", place.cookie(client)) as socket,
    ):
        numbers = itertools.count()

        def hold(button: float) -> bool:
            socket.send(struct.pack("<5f2I", 0.0, 0.0, 0.0, 0.0, button, next(numbers), 0))
            return bool(place.station.sticks) and place.station.sticks[-1][1]

        hold(0.0)
        until(lambda: hold(1.0))
        outside(place.data).end_sessions("oleg")
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            while socket.close_code is None:
                hold(1.0)
                with contextlib.suppress(TimeoutError):  # as often as a page does
                    socket.recv(0.02)
        until(lambda: place.station.sticks[-1] == ((0.0, 0.0, 0.0, 0.0), False))


@pytest.mark.parametrize("change", ["role", "password", "remove", "end"])
def test_a_change_by_another_process_takes_effect_at_the_next_request(
    place: Any, change: str
) -> None:
    with browser_of(place, "oleg") as client:
        assert client.post("/api/commands/arm", json={}).status_code == 200
        accounts = outside(place.data)
        changes: dict[str, Callable[[], object]] = {
            "role": lambda: accounts.set_role("oleg", Role.VIEWER),
            "password": lambda: accounts.set_password("oleg", OTHER),
            "remove": lambda: accounts.remove("oleg"),
            "end": lambda: accounts.end_sessions("oleg"),
        }
        changes[change]()
        place.station.requests.clear()
        assert client.post("/api/commands/arm", json={}).status_code == 401
        assert place.station.requests == []


def test_the_new_role_holds_from_the_next_sign_in_on(place: Any) -> None:
    outside(place.data).set_role("oleg", Role.VIEWER)
    with browser_of(place, "oleg") as client:
        assert client.post("/api/commands/arm", json={}).status_code == 403


def test_signing_out_everywhere_ends_all_of_ones_own(place: Any) -> None:
    with (
        browser_of(place, "oleg") as one,
        browser_of(place, "oleg") as two,
        browser_of(place, "anna") as other,
    ):
        assert one.post("/api/session/sign_out", json={"everywhere": True}).status_code == 200
        statuses = [c.get("/api/session").status_code for c in (one, two, other)]
    assert statuses == [401, 401, 200]


def test_ones_own_password_is_changed_with_the_old_one(place: Any) -> None:
    with browser_of(place, "oleg") as client, browser_of(place, "oleg") as elsewhere:
        change = {"current": OTHER, "password": OTHER}
        wrong = client.put("/api/session/password", json=change)
        assert wrong.status_code == 403
        assert wrong.json()["error"] == "the current password is wrong"
        short = client.put("/api/session/password", json={"current": WORDS, "password": "short"})
        assert short.status_code == 409
        assert "at least 10" in short.json()["error"]
        assert client.get("/api/session").status_code == 200
        change["current"] = WORDS
        assert client.put("/api/session/password", json=change).status_code == 200
        assert client.get("/api/session").status_code == 200, "this browser stays signed in"
        assert elsewhere.get("/api/session").status_code == 401
    assert log_in(place, "oleg").status_code == 401
    assert log_in(place, "oleg", OTHER).status_code == 200


def test_who_came_by_a_link_has_no_password(place: Any) -> None:
    with place.sign_in() as client:
        change = {"current": WORDS, "password": OTHER}
        answer = client.put("/api/session/password", json=change)
    assert answer.status_code == 409
    assert "signed in by a link" in answer.json()["error"]


def test_an_admin_sees_and_manages_users(place: Any) -> None:
    with browser_of(place, "anna") as admin, place.invited(admin, "operator") as guest:
        made = admin.post("/api/users", json={"name": "gina", "role": "viewer", "password": WORDS})
        assert made.status_code == 201
        with browser_of(place, "gina") as gina:
            users = {user["name"]: user for user in admin.get("/api/users").json()}
            label = guest.get("/api/session").json()["label"]
            assert {"anna", "oleg", "vera", "gina", label} == set(users)
            assert users["gina"]["sessions"] == 1
            assert users["gina"]["last_seen"] > 1_700_000_000
            assert users["oleg"] == {
                "name": "oleg",
                "role": "operator",
                "account": True,
                "sessions": 0,
                "last_seen": 0,
            }
            assert users[label]["account"] is False
            promoted = admin.put("/api/users/gina/role", json={"role": "operator"})
            assert promoted.status_code == 200
            assert gina.get("/api/session").status_code == 401
        assert admin.put("/api/users/gina/password", json={"password": OTHER}).status_code == 200
        assert log_in(place, "gina", OTHER).json()["role"] == "operator"
        assert admin.post(f"/api/users/{label}/end_sessions").status_code == 200
        assert guest.get("/api/session").status_code == 401
        assert admin.delete("/api/users/gina").status_code == 200
        assert log_in(place, "gina", OTHER).status_code == 401
        told = lines(admin)
    for text in ("anna added gina as viewer", "anna made gina operator", "anna removed gina"):
        assert text in told
    assert f"anna ended the sessions of {label}" in told


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "said"),
    [
        ("DELETE", "/api/users/nobody", None, 409, "no user 'nobody'; there are anna, oleg, vera"),
        ("DELETE", "/api/users/anna", None, 409, "last admin"),
        ("PUT", "/api/users/anna/role", {"role": "viewer"}, 409, "last admin"),
        ("PUT", "/api/users/oleg/role", {"role": "boss"}, 422, "role"),
        ("POST", "/api/users", {"name": "B", "password": WORDS}, 400, "not a valid user name"),
        ("POST", "/api/users", {"name": "bob", "password": "short"}, 409, "at least 10"),
        ("POST", "/api/users", {"name": "oleg", "password": WORDS}, 409, "has an account"),
        ("POST", "/api/users/viewer%209/end_sessions", None, 409, "no one is signed in"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    place: Any, method: str, path: str, body: Any, status: int, said: str
) -> None:
    with browser_of(place, "anna") as admin:
        answer = admin.request(method, path, json=body)
    assert answer.status_code == status
    assert said in answer.json()["error"]
    assert "\n" not in answer.json()["error"]


def test_operators_invite_viewers_and_admins_operators_too(place: Any) -> None:
    with browser_of(place, "oleg") as oleg, browser_of(place, "anna") as anna:
        answer = oleg.post("/api/invitations", json={"role": "operator"})
        assert answer.status_code == 403
        assert "may invite viewers" in answer.json()["error"]
        with place.invited(oleg, "viewer") as guest:
            assert guest.get("/api/session").json()["role"] == "viewer"
        with place.invited(anna, "operator") as guest:
            assert guest.get("/api/session").json()["role"] == "operator"
        assert anna.post("/api/invitations", json={"role": "admin"}).status_code == 422
