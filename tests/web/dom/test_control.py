"""The strip that shows who commands, and the help."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.fixture
def page(kept_page: Any, flying: Any) -> Any:
    return kept_page


def test_the_page_says_who_has_control_and_asks_for_it(page: Any, look: Any, station: Any) -> None:
    me = page.inner_text("#who")
    station.control("")
    look.text("#control", "Nobody in control")
    station.control(me)
    look.text("#control", "^you have control")
    station.control("anna")
    look.text("#control", "^anna has control")
    look.has_class("#control", "theirs")
    station.requests.clear()
    with page.expect_response("**/api/control"):
        page.click("#control >> text=Ask")
    assert [(s, r.action) for s, r in station.requests] == [("control", "ask")]


def test_who_has_control_answers_who_asks(page: Any, look: Any, station: Any) -> None:
    me = page.inner_text("#who")
    station.control(me, "ben", 17.0)
    look.text("#control", "ben asks for it ?17 s")
    station.requests.clear()
    with page.expect_response("**/api/control"):
        page.click("#control >> text=Give >> nth=-1")
    assert station.requests[-1][1].action == "give"


def test_control_that_is_not_known_is_not_shown_as_free(page: Any, look: Any, station: Any) -> None:
    station.control("anna")
    look.text("#control", "anna")
    look.text("#control", "not known")  # after 2 s without a report of the station


def test_keys_do_nothing_while_somebody_types(page: Any) -> None:
    page.click("[data-tab=gains]")
    page.fill("#search", "")
    page.type("#search", "2?1")
    assert page.input_value("#search") == "2?1"
    assert page.is_visible("#tab-gains")
