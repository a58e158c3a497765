"""Tokens work once, and what the door remembers survives a restart."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from quadrotor.errors import StorageError
from web.door import Door, Role, Session


def test_a_token_signs_one_browser_in_and_is_consumed(tmp_path: Path) -> None:
    door = Door(tmp_path)
    token = door.token
    assert door.consume(token) == Session("operator 1", Role.OPERATOR)
    assert door.consume(token) is None
    assert door.was_used(token)


def test_a_fresh_token_is_minted_when_one_is_consumed(tmp_path: Path) -> None:
    door = Door(tmp_path)
    first = door.token
    door.consume(first)
    assert door.token != first
    assert door.consume(door.token) == Session("operator 2", Role.OPERATOR)


def test_a_wrong_token_consumes_nothing(tmp_path: Path) -> None:
    door = Door(tmp_path)
    token = door.token
    assert door.consume("wrong") is None
    assert door.consume("") is None
    assert not door.was_used("wrong")
    assert door.token == token


def test_sessions_and_unused_tokens_survive_a_restart(tmp_path: Path) -> None:
    door = Door(tmp_path)
    session = door.consume(door.token)
    assert session is not None
    cookie, unused = door.sign(session), door.token
    again = Door(tmp_path)
    assert again.session(cookie) == session
    assert again.token == unused
    assert again.consume(unused) == Session("operator 2", Role.OPERATOR)


def test_a_supervisor_cannot_bring_a_used_token_back(tmp_path: Path) -> None:
    door = Door(tmp_path, "given")
    assert door.token == "given"
    assert door.consume("given") is not None
    again = Door(tmp_path, "given")
    assert again.consume("given") is None
    assert again.token != "given"


def test_a_given_token_is_accepted_again_while_unused(tmp_path: Path) -> None:
    Door(tmp_path, "given")
    assert Door(tmp_path, "given").consume("given") is not None


def test_a_viewer_token_makes_a_viewer(tmp_path: Path) -> None:
    door = Door(tmp_path)
    before = door.token
    session = door.consume(door.mint(Role.VIEWER))
    assert session == Session("viewer 1", Role.VIEWER)
    assert door.token == before


def test_the_file_is_readable_by_its_owner_only(tmp_path: Path) -> None:
    Door(tmp_path / "web").mint(Role.OPERATOR)
    path = tmp_path / "web" / "door.json"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("cookie", [None, "", "x", "eyJsYWJlbCI6Im9wZXJhdG9yIDEifQ.a.b"])
def test_a_forged_cookie_is_no_session(tmp_path: Path, cookie: str | None) -> None:
    assert Door(tmp_path).session(cookie) is None


def test_a_cookie_of_another_data_folder_is_no_session(tmp_path: Path) -> None:
    other = Door(tmp_path / "other")
    session = Session("operator 1", Role.OPERATOR)
    assert Door(tmp_path / "ours").session(other.sign(session)) is None


@pytest.mark.parametrize("content", ["", "{", "[]", '{"secret": "x"}'])
def test_a_damaged_file_is_said_in_one_line(tmp_path: Path, content: str) -> None:
    (tmp_path / "door.json").write_text(content)
    with pytest.raises(StorageError, match=r"door\.json is damaged; delete it") as caught:
        Door(tmp_path)
    assert "\n" not in str(caught.value)


def test_unused_tokens_of_many_starts_do_not_pile_up(tmp_path: Path) -> None:
    for start in range(50):
        door = Door(tmp_path, f"token {start}")
    assert door.token == "token 49"
    assert door.consume("token 0") is None
    assert door.consume("token 48") is not None
