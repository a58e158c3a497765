"""The bell: what happened, on every page, with what has not been seen."""

from __future__ import annotations

import time
from typing import Any

from web.live.events import event

ITEMS = "#events li"


def happen(station: Any, *lines: tuple[str, str]) -> None:
    for level, text in lines:
        station._hub.publish_from_thread(event(level, text, "quad1", time.time()))


def test_a_line_that_comes_again_is_counted_and_the_bell_counts_what_was_not_seen(
    page: Any, look: Any, station: Any
) -> None:
    page.keyboard.press("Escape")  # the help of the first visit
    page.click("#bell")
    page.keyboard.press("Escape")
    look.text("#bell", "^$")
    happen(station, ("info", "first"), ("warn", "gust"), ("info", "last"), ("warn", "gust"))
    look.text(f"{ITEMS} >> nth=0", r"gust\(2 times\)$")
    look.text(f"{ITEMS} >> nth=1", "last$")
    look.text("#bell", "^3$")
    assert page.get_attribute("#bell", "data-tone") == "warn"
    assert page.get_attribute("#bell", "aria-label") == "events, 3 unread"
    page.click("#bell")
    look.text("#bell", "^$")
    page.select_option("#event-center select", "warn")
    assert page.locator(f"{ITEMS} >> visible=true").count() == 1
    page.reload()
    page.wait_for_selector(ITEMS, state="attached")
    look.text("#bell", "^$")


def test_other_pages_have_the_same_events(page: Any, look: Any, site: Any, station: Any) -> None:
    happen(station, ("warn", "seen from the runs"))
    page.goto(f"{site.base}/runs")
    page.click("#bell")
    look.text(f"{ITEMS} >> nth=0", "seen from the runs")
