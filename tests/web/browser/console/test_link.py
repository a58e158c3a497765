"""Ages and the Link tab: what is old is marked, and which of two links is slow."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from vehicle_link.messages import header, new

MARK = "getComputedStyle(document.querySelector('{}'), '::before').content"


@pytest.fixture
def page(kept_page: Any, flying: Any) -> Any:
    return kept_page


def marked(page: Any, selector: str) -> bool:
    """Return whether an element carries the mark of old values, in addition to its colour."""
    return bool(page.evaluate(MARK.format(selector)) == '"○"')


def test_what_is_old_has_a_sign_and_says_when_it_was_heard(
    page: Any, look: Any, flying: Any, until: Callable[..., None]
) -> None:
    look.text("#battery", "^15.6 V$")
    look.has_no_class("#battery", "stale")
    until(lambda: not marked(page, "#battery"))
    flying(False)
    look.has_class("#behavior", "stale")
    assert marked(page, "#behavior")
    look.has_class("#battery", "stale")
    assert page.get_attribute("#battery", "title").startswith("last received ")
    look.has_class("#chart-0 .legend output >> nth=0", "stale")
    look.text("#chart-0 .legend output >> nth=0", r"\d")
    look.text("#table tbody tr >> nth=0 >> td.age", "^○")
    flying(True)
    look.has_no_class("#battery", "stale")
    until(lambda: not page.get_attribute("#battery", "title"))


def contrast(one: str, other: str) -> float:
    def luminance(color: str) -> float:
        parts = [int(color[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return float(0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2])

    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


PIXEL = """(name) => { const probe = document.body.appendChild(document.createElement('i'));
  const pen = document.createElement('canvas').getContext('2d');
  probe.style.color = `var(--${name})`;
  pen.fillStyle = getComputedStyle(probe).color;
  pen.fillRect(0, 0, 1, 1);
  const parts = [...pen.getImageData(0, 0, 1, 1).data].slice(0, 3);
  return '#' + parts.map((part) => part.toString(16).padStart(2, '0')).join(''); }"""
"""Script that returns a colour of the design as #rrggbb."""


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_old_numbers_are_legible_and_clearly_greyer_than_live_ones(page: Any, theme: str) -> None:
    page.emulate_media(color_scheme=theme)
    color = {name: page.evaluate(PIXEL, name) for name in ("stale", "text", "panel")}
    page.emulate_media(color_scheme="dark")
    assert contrast(color["stale"], color["panel"]) >= 4.5
    assert contrast(color["text"], color["stale"]) >= 2.0


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


def test_the_link_tab_tells_figures_state_outages_and_the_loop_on_board(
    page: Any, look: Any, link: Any, station: Any
) -> None:
    page.click("[data-tab=link]")
    link(state_duration=151.0)
    look.text("#tab-link .state", "^● good$")
    look.text("#tab-link .link-state", "for 02:31")
    look.text("#tab-link p >> nth=0", "No outage longer than 0.2 s")
    look.text("#tab-link .strip:has-text('Round trip') output >> nth=0", r"^3\.1 ms$")
    look.text("#tab-link .strip:has-text('Loss') output", r"^1\.5 %$")
    link(
        state="lost",
        state_duration=2.5,
        outages=2,
        outage_last=2.5,
        outage_longest=2.5,
        outage_total=3.0,
    )
    look.text("#tab-link .state", "^○ lost$")
    look.has_class("#tab-link .state", "warn")
    look.text("#tab-link p >> nth=0", "^2 outages .*last 2.5 s, the longest 2.5 s, together 3.0 s")
    look.text("#tab-link .reaction", "its parameters have not been read")
    assert page.is_hidden("#tab-link .problem")
    link(
        address="10.0.0.2:7447",
        access="observer",
        path="datagram",
        reopened=2,
        problem="this station's certificate lets it observe quad1, not command it",
    )
    look.text("#tab-link .problem", "^⚠ Not commanded from here: this station's certificate")
    look.text(
        "#tab-link .way",
        "^Connected to 10.0.0.2:7447, signed in as observer, telemetry by UDP, reopened 2 times",
    )
    # The flight loop on board: only growth is marked.
    look.text("#tab-link .bin .count >> nth=0", "^91k$")
    said = page.get_attribute("#tab-link .histogram", "aria-label")
    assert said.startswith("below 50 µs: 91234, below 100 µs: 8123, ")
    assert said.endswith("below 5 ms: 0, longer: 1")
    heights = page.eval_on_selector_all(
        "#tab-link .column i", "bars => bars.map((bar) => bar.getBoundingClientRect().height)"
    )
    assert heights == [*sorted(heights[:5], reverse=True), 0, 0, heights[7]]
    assert heights[7] > 0, "a single tick is seen"
    missed = "#tab-link .loop-count:has-text('Missed frames')"
    look.text(missed, "5since the start$")
    look.has_no_class(f"{missed} >> output", "warn")
    station.said = {"missed_frames": 8}
    look.text(missed, "8▲ 3 in the last 10 s$")
    look.has_class(f"{missed} >> output", "warn")
    look.text("#tab-link .loop-count:has-text('Overruns')", "2since the start$")


def test_a_link_is_plotted_while_the_tab_was_closed(
    open_page: Any, site: Any, flying: Any, look_at: Any, link: Any, until: Callable[..., None]
) -> None:
    page = open_page(site)
    look_at(page).text("#link", "ms")
    page.wait_for_timeout(600)  # samples arrive five times a second
    page.click("[data-tab=link]")
    drawn = """() => { const c = document.querySelector('#tab-link canvas');
      return c.width > 0 && c.getContext('2d').getImageData(0, 0, c.width, c.height).data
        .some((v) => v > 0); }"""
    until(lambda: page.evaluate(drawn))
    label = page.get_attribute("#tab-link canvas >> nth=0", "aria-label")
    assert label == "Round trip, last five minutes: 3.1 ms to 3.1 ms"
