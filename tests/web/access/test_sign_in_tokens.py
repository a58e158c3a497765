"""Tokens work once, and their state survives a restart."""

from __future__ import annotations

import stat
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from quadrotor.errors import StorageError
from tests.support.clock import Clock
from web.access.database import AccessDatabase
from web.access.roles import Role, Session
from web.access.sessions import SESSION_AGE, Sessions
from web.access.sign_in_tokens import SignInTokens
from web.access.signed_links import SignedLinks


def open_door(folder: Path, given: str | None = None, clock: Clock | None = None) -> SignInTokens:
    return SignInTokens(
        folder, Sessions(AccessDatabase(folder), clock or Clock(1_800_000_000.0)), given
    )


def who(session: Session | None) -> tuple[str, Role] | None:
    return None if session is None else (session.label, session.role)


def test_a_token_signs_one_browser_in_and_is_consumed(tmp_path: Path) -> None:
    tokens = open_door(tmp_path)
    token = tokens.token
    assert who(tokens.consume(token)) == ("admin 1", Role.ADMIN)
    assert tokens.consume(token) is None
    assert tokens.was_used(token)


def test_a_fresh_token_is_minted_when_one_is_consumed(tmp_path: Path) -> None:
    tokens = open_door(tmp_path)
    first = tokens.token
    tokens.consume(first)
    assert tokens.token != first
    assert who(tokens.consume(tokens.token)) == ("admin 2", Role.ADMIN)


def test_a_wrong_token_consumes_nothing(tmp_path: Path) -> None:
    tokens = open_door(tmp_path)
    token = tokens.token
    assert tokens.consume("wrong") is None
    assert tokens.consume("") is None
    assert not tokens.was_used("wrong")
    assert tokens.token == token


def test_sessions_and_unused_tokens_survive_a_restart(tmp_path: Path) -> None:
    tokens = open_door(tmp_path)
    session = tokens.consume(tokens.token)
    assert session is not None
    cookie, unused = tokens.sign(session), tokens.token
    again = open_door(tmp_path)
    assert again.session(cookie) == session
    assert again.token == unused
    assert who(again.consume(unused)) == ("admin 2", Role.ADMIN)


def test_a_supervisor_cannot_bring_a_used_token_back(tmp_path: Path) -> None:
    tokens = open_door(tmp_path, "given")
    assert tokens.token == "given"
    assert tokens.consume("given") is not None
    again = open_door(tmp_path, "given")
    assert again.consume("given") is None
    assert again.token != "given"


def test_a_given_token_is_accepted_again_while_unused(tmp_path: Path) -> None:
    open_door(tmp_path, "given")
    assert open_door(tmp_path, "given").consume("given") is not None


def test_a_viewer_token_makes_a_viewer(tmp_path: Path) -> None:
    tokens = open_door(tmp_path)
    before = tokens.token
    session = tokens.consume(tokens.mint(Role.VIEWER))
    assert who(session) == ("viewer 1", Role.VIEWER)
    assert tokens.token == before


def test_the_file_is_readable_by_its_owner_only(tmp_path: Path) -> None:
    open_door(tmp_path / "web").mint(Role.OPERATOR)
    path = tmp_path / "web" / "door.json"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("cookie", [None, "", "x", "eyJsYWJlbCI6Im9wZXJhdG9yIDEifQ.a.b"])
def test_a_forged_cookie_is_no_session(tmp_path: Path, cookie: str | None) -> None:
    assert open_door(tmp_path).session(cookie) is None


def test_a_cookie_of_another_data_folder_is_no_session(tmp_path: Path) -> None:
    other = open_door(tmp_path / "other")
    session = other.consume(other.token)
    assert session is not None
    assert open_door(tmp_path / "ours").session(other.sign(session)) is None


def test_a_signed_cookie_whose_session_was_never_opened_is_none(tmp_path: Path) -> None:
    """The signing secret alone opens nothing."""
    tokens = open_door(tmp_path)
    made_up = Session("admin 9", Role.ADMIN, "x", 0, 1_800_000_000)
    assert tokens.session(tokens.sign(made_up)) is None


@pytest.mark.parametrize(
    "change", [{"role": Role.ADMIN}, {"label": "admin 1"}, {"generation": 3}, {"issued": 2**40}]
)
def test_a_signed_cookie_that_says_more_than_its_session_is_none(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    tokens = open_door(tmp_path)
    session = tokens.consume(tokens.mint(Role.VIEWER))
    assert session is not None
    assert tokens.session(tokens.sign(session)) == session
    assert tokens.session(tokens.sign(replace(session, **change))) is None


def test_a_session_ends_with_its_age(tmp_path: Path) -> None:
    clock = Clock(1_800_000_000.0)
    tokens = open_door(tmp_path, clock=clock)
    session = tokens.consume(tokens.token)
    assert session is not None
    cookie = tokens.sign(session)
    clock.now += SESSION_AGE - 1
    assert tokens.session(cookie) == session
    clock.now += 1
    assert tokens.session(cookie) is None


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0, -40 * 86400.0, 40 * 86400.0])
def test_a_step_of_the_computers_clock_signs_nobody_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step_s: float
) -> None:
    tokens = SignInTokens(tmp_path, Sessions(AccessDatabase(tmp_path)))
    links = SignedLinks(tokens.secret)
    session = tokens.consume(tokens.token)
    assert session is not None
    cookie, token, link = tokens.sign(session), tokens.sign_link(session), links.make("run_1")
    computers = time.time
    monkeypatch.setattr(time, "time", lambda: computers() + step_s)
    assert tokens.session(cookie) == session
    assert tokens.session_of_link(token) == session
    path, _, query = link.partition("?")
    scope = {"type": "http", "method": "GET", "path": path, "query_string": query.encode()}
    assert links.opens(scope)


def test_a_token_of_strange_letters_is_wrong_and_no_defect(tmp_path: Path) -> None:
    assert open_door(tmp_path).consume("tökén") is None


@pytest.mark.parametrize("content", ["", "{", "[]", '{"secret": "x"}'])
def test_a_damaged_file_is_said_in_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "door.json").write_text(content)
    with pytest.raises(StorageError, match=r"door\.json is damaged; delete it") as caught:
        open_door(tmp_path)
    assert "\n" not in str(caught.value)


def test_unused_tokens_of_many_starts_do_not_pile_up(tmp_path: Path) -> None:
    for start in range(50):
        tokens = open_door(tmp_path, f"token {start}")
    assert tokens.token == "token 49"
    assert tokens.consume("token 0") is None
    assert tokens.consume("token 48") is not None
