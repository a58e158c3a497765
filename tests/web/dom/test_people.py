"""Sign-in with a password, the menu of the signed-in person, and sign-out."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from web.access.accounts import Accounts
from web.access.database import AccessDatabase
from web.access.passwords import Passwords
from web.access.roles import Role

WORDS = "correct horse battery"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    data = tmp_path_factory.mktemp("people")
    catalogue = Catalogue(data)
    with serve(data, catalogue) as running:
        accounts = Accounts(AccessDatabase(data / "web"), Passwords(1, 8))
        for name, role in (("anna", Role.ADMIN), ("oleg", Role.OPERATOR), ("vera", Role.VIEWER)):
            accounts.add(name, role, WORDS)
        yield running
    catalogue.close()


@pytest.fixture
def tab(context: Any) -> Any:
    made = context.new_page()
    return made


def log_in(tab: Any, place: Any, name: str, password: str = WORDS) -> None:
    tab.goto(f"{place.base}/")
    tab.fill("input[name=name]", name)
    tab.fill("input[name=password]", password)
    tab.click(".people button")


def test_signing_in_with_a_password_and_out_again(place: Any, tab: Any, look_at: Any) -> None:
    look = look_at(tab)
    log_in(tab, place, "anna", "wrong " + WORDS)
    look.text("h1", "^The name or the password is wrong.$")
    look.value("input[name=name]", "anna")
    look.value("input[name=password]", "")
    tab.fill("input[name=password]", WORDS)
    tab.keyboard.press("Enter")
    tab.wait_for_selector("#behaviors button")
    assert tab.url == f"{place.base}/"
    look.text("#who", "^anna$")
    tab.click("#who")
    look.text("#people p >> nth=0", "^anna admin$")
    tab.click("#sign-out")
    tab.wait_for_selector("input[name=password]")
    tab.goto(f"{place.base}/")
    look.text("h1", "not signed in")


def test_an_admin_sees_the_users_and_ends_sessions(place: Any, tab: Any, look_at: Any) -> None:
    look = look_at(tab)
    other = tab.context.another()
    theirs = other.new_page()
    log_in(theirs, place, "oleg")
    theirs.wait_for_selector("#behaviors button")
    theirs.click("#who")
    assert theirs.locator("#users .user").count() == 0, "users are seen by admins"
    log_in(tab, place, "anna")
    tab.click("#who")
    look.text("#users .user >> nth=1 >> .name", "^oleg$")
    tab.click("#users .user >> nth=1 >> button")
    look_at(theirs).text("#contact", "Signed out. Sign in to come back")
    look.text("#events", "anna ended the sessions of oleg")
    other.close()


def test_an_admin_changes_a_role_and_a_refusal_is_shown(place: Any, tab: Any, look_at: Any) -> None:
    look = look_at(tab)
    log_in(tab, place, "anna")
    tab.click("#who")
    for role in ("operator", "viewer"):
        tab.select_option("#users .user:has-text('vera') select", role)
        look.text("#events", f"anna made vera {role}")
    tab.select_option("#users .user:has-text('anna') select", "viewer")
    look.text("#people .note", "anna is the last admin and cannot be made viewer")
    look.value("#users .user:has-text('anna') select", "admin")


def test_a_viewers_controls_are_disabled(place: Any, tab: Any) -> None:
    log_in(tab, place, "vera")
    tab.wait_for_selector("#behaviors button")
    for control in ("#arm", "#take-off", "#land", "#cut", "#record"):
        assert tab.locator(control).is_disabled(), control
    assert not tab.locator("#invite").is_visible()


def test_a_link_is_made_once_and_shown_whatever_tab_is_open(
    place: Any, tab: Any, look_at: Any
) -> None:
    minted: list[str] = []
    tab.on("request", lambda one: minted.append(one.url) if "/invitations" in one.url else None)
    log_in(tab, place, "oleg")
    tab.wait_for_selector("#behaviors button")
    tab.keyboard.press("Escape")  # the help of a first visit
    look = look_at(tab)
    for panel in ("fly", "gains", "calibrate"):
        minted.clear()
        tab.click(f"[data-tab={panel}]")
        tab.dblclick("#invite")
        look.value("#invitation input", re.compile(r"\?token=.{20,}$"))
        look.text("#invitation p", "^A link for one viewer, for one use")
        first = tab.input_value("#invitation input")
        tab.click("#invite")
        assert tab.locator("#invitation input").is_visible()
        assert tab.get_attribute(f"[data-tab={panel}]", "aria-selected") == "true"
        assert (tab.input_value("#invitation input"), len(minted)) == (first, 1)
        tab.click("#invitation button:text-is('Another')")
        look.value("#invitation input", re.compile(f"^(?!{re.escape(first)}).+token="))
        tab.click("#invitation button:text-is('Close')")
        assert not tab.locator("#invitation").is_visible()
