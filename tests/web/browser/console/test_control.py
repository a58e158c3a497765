"""The strip that shows who commands, and the help, in Chromium."""

from __future__ import annotations

from typing import Any

import pytest


@pytest.fixture
def page(kept_page: Any, flying: Any) -> Any:
    return kept_page


def test_a_first_visit_explains_itself_and_the_help_is_one_key_away(
    open_page: Any, site: Any, flying: Any, look_at: Any
) -> None:
    page = open_page(site)
    look = look_at(page)
    look.text("#help-panel", "Your first flight.*Hold Arm")
    assert page.is_enabled("#emergency-land")  # nothing covers the bar
    page.click("#emergency-land", trial=True)
    page.keyboard.press("Escape")
    assert not page.is_visible("#help-panel")
    page.reload()
    page.wait_for_selector("#behaviors button")
    assert not page.is_visible("#help-panel")
    page.keyboard.press("?")
    look.text("#help-panel", "this help")
    page.keyboard.press("?")
    assert not page.is_visible("#help-panel")
