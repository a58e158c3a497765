"""Ages and the Link tab: what is old is marked, and which of two links is slow."""

from __future__ import annotations

from typing import Any

import pytest

from vehicle_link.messages import header, new
from web.latest import STALE, TICKS


@pytest.fixture
def page(kept_page: Any, flying: Any) -> Any:
    return kept_page


def test_every_number_of_the_vehicle_has_a_deadline(page: Any) -> None:
    page.click("[data-tab=link]")
    topics = page.evaluate(
        "[...document.querySelectorAll('[data-topic]')].map((one) => one.dataset.topic)"
    )
    assert set(topics) <= STALE.keys()
    assert page.locator("#bar output:not([data-topic])").count() == 0
    assert page.locator("#table tbody tr:not([data-topic])").count() == 0


def test_a_number_is_grey_while_its_own_message_is_missing(
    page: Any, look: Any, station: Any, flying: Any
) -> None:
    mass = "#table tbody tr:nth-child(13) td:nth-child(2)"
    look.text(mass, r"^1\.310$")
    fly, put = station.fly, station.put
    station.put = lambda topic, message: topic == "estimator" or put(topic, message)
    try:
        look.has_class(mass, "stale")
        look.text(mass, r"^1\.310$")
    finally:
        station.put = put
    assert station.fly == fly
    look.has_no_class(mass, "stale")


def test_silence_of_the_vehicle_shows_before_the_station_says_so(
    page: Any, look: Any, station: Any
) -> None:
    look.has_no_class("#link", "warn")
    put = station.put
    station.put = lambda topic, message: topic == TICKS or put(topic, message)
    try:
        look.has_class("#link", "warn")  # the station's own status still arrives and is good
        look.text("#flags", "^no telemetry for")
    finally:
        station.put = put
    look.has_no_class("#link", "warn")
    look.text("#flags", "^(?!no telemetry)")


# ---------------------------------------------------------------------- link
@pytest.fixture
def link(station: Any) -> Any:
    """Return `link(state="lost", …)`, which changes the link in the station's reports."""
    said: dict[str, Any] = {"state": "good", "round_trip": 0.0031, "loss": 0.015, "age": 0.012}
    put = station.put

    def replaced(topic: str, message: Any) -> None:
        if topic == "link_status":
            message = new("quadlab_msgs/LinkStatus", header=header(0), **said)
        put(topic, message)

    station.put = replaced
    yield said.update
    station.put = put


def test_a_slow_page_is_told_from_a_bad_radio(page: Any, look: Any, link: Any) -> None:
    page.click("[data-tab=link]")
    look.text("#tab-link .strip:has-text('Frames') output", r"\d+ Hz")
    page.evaluate(
        """() => { const { parse } = JSON;
        JSON.parse = (text, ...rest) => {
          const read = parse(text, ...rest);
          if (typeof read?.pong === 'number') read.pong -= 400;
          return read;
        }; }"""
    )
    look.text("#tab-link .verdict", "^The radio is good: it is this browser or its way .* ms")
    link(state="degraded")
    look.text("#tab-link .verdict", "^It is this browser")
