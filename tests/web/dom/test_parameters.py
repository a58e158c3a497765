"""Gains tab: one and a second operator, presets, files, earlier values."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.parameters.history import ParameterHistory, RecordedChange

DEFAULTS = {"gains.kp": 4.0, "gains.laps": 3, "gains.exact": False, "gains.rate": "nominal"}
KP = ".gain:has(input[aria-label='gains.kp'])"
SLIDER, CELL, TICK = f"{KP} input[type=range]", f"{KP} input.value", f"{KP} .confirmed"


@pytest.fixture(scope="module")
def console(kept_context: Any, site: Any) -> Iterator[Any]:
    """Yield one page for all tests here, of a vehicle that publishes; its scripts may not fail."""
    going, problems = threading.Event(), []
    going.set()

    def fly() -> None:
        while going.is_set():
            site.station.fly()
            threading.Event().wait(0.02)

    thread = threading.Thread(target=fly, daemon=True)
    thread.start()
    page = kept_context.new_page()
    page.on("pageerror", lambda error: problems.append(f"{error}\n{error.stack}"))
    page.goto(f"{site.base}/?token={site.token}")
    page.wait_for_selector("#behaviors button")
    yield page
    page.close()
    going.clear()
    thread.join()
    assert problems == []


@pytest.fixture
def gains(console: Any, station: Any) -> Iterator[Any]:
    """Yield the Gains tab with its tree open and all values at their defaults."""
    console.click("[data-tab=gains]")
    if console.locator("#parameter-views [aria-pressed=true]").count():
        console.click("#parameter-views [aria-pressed=true]")
    console.wait_for_selector("#gains summary")
    console.evaluate("document.querySelectorAll('#gains details').forEach((d) => (d.open = true))")
    console.wait_for_selector(SLIDER, state="visible")
    yield console
    change(console, DEFAULTS)


@pytest.fixture
def look(gains: Any, look_at: Any) -> Any:
    return look_at(gains)


def change(page: Any, values: dict[str, Any]) -> None:
    """Change a parameter as another page of the same person would."""
    page.evaluate(
        "(values) => fetch('/api/parameters', { method: 'PUT', body: JSON.stringify({ values }),"
        " headers: { 'Content-Type': 'application/json' } })",
        values,
    )


def open_again(page: Any) -> None:
    page.reload()
    page.wait_for_selector("#behaviors button")
    page.click("[data-tab=gains]")


def test_a_change_stands_among_the_events_at_the_flights_time(
    gains: Any, look: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    noon = datetime(2026, 1, 31, 12, 34, 56).timestamp()  # a time of no other event
    monkeypatch.setattr("web.parameters.replica.wall_time", lambda: noon)
    change(gains, {"gains.kp": 9.5})
    look.text("#events li:first-child", r"12:34:56\s*gains\.kp 4 → 9\.5")


def test_a_change_touches_its_own_row_and_builds_nothing(gains: Any, look: Any) -> None:
    gains.evaluate(
        """() => {
          window.touched = new Set();
          window.built = 0;
          window.observer = new MutationObserver((records) => {
            for (const { target, addedNodes, removedNodes } of records) {
              const row = (target.closest ? target : target.parentElement).closest(".gain");
              touched.add(row ? row.querySelector("input").ariaLabel : "count");
              built += addedNodes.length + removedNodes.length;
            }
          });
          observer.observe(document.getElementById("gains"),
            { subtree: true, childList: true, attributes: true, characterData: true });
        }"""
    )
    change(gains, {"gains.kp": 11.5})
    look.value(CELL, "11.5")
    assert set(gains.evaluate("[...touched]")) <= {"gains.kp, value", "count"}
    assert gains.evaluate("observer.disconnect() || built") == 0


def test_a_search_looks_in_unit_and_meaning_and_open_branches_are_remembered(
    gains: Any, look: Any
) -> None:
    gains.fill("#search", "NUMBER of laps")
    look.text(".gain:visible .label", "laps")
    gains.fill("#search", "1/s²")
    look.text(".gain:visible .label", "kp")
    gains.fill("#search", "nothing like it")
    assert gains.locator("#nothing-found").is_visible()
    gains.fill("#search", "")
    gains.evaluate("document.querySelector('#gains details').open = false")
    gains.click("#gains summary")
    open_again(gains)
    gains.wait_for_selector(SLIDER, state="visible")
    gains.click(f"{KP} .fold")
    look.text(f"{KP} .details .facts >> nth=0", "default 4 · 0 to 20 1/s²")
    fixed = ".gain:has(input[aria-label='gains.fixed'])"
    assert gains.locator(f"{fixed} input.value").is_disabled()
    gains.click(f"{fixed} .fold")
    look.text(f"{fixed} .details .facts >> nth=1", "start quadlab with --set gains.fixed=…")


def test_presets_are_compared_before_they_act_and_a_file_by_its_lines(
    gains: Any, look: Any, station: Any, tmp_path: Path
) -> None:
    change(gains, {"gains.kp": 9.0, "gains.laps": 5})
    look.value(CELL, "9")
    gains.click("#parameter-views >> text=Presets")
    gains.fill("[aria-label='name of the new preset']", "quick")
    gains.click("#parameter-panel form button")
    look.text("#parameter-panel .answer", "Saved quick with 4 values")
    change(gains, DEFAULTS)
    gains.click("#parameter-views >> text=Presets")
    gains.click("#parameter-views >> text=Presets")  # read again
    station.requests.clear()
    gains.click("[aria-label='compare with preset quick']")
    look.text(".diff li:has-text('gains.kp') .values", "4 → 9 1/s²")
    assert station.requests == [], "nothing is sent before it is seen"
    gains.click(".diff .apply")
    look.text("#parameter-panel .applied", "Applied 2 values")
    assert len(station.requests) == 1, "all at once"
    gains.click("[aria-label='delete preset quick']")
    gains.click("#parameter-panel .answer:not(.applied) button")
    look.text("#parameter-panel .answer:not(.applied)", "quick is back")

    file = tmp_path / "values.toml"
    file.write_text("[gains]\nkp = 99.0\nlaps = 7\nexact = true\nold = 1\n")
    gains.click("#parameter-views >> text=File")
    gains.set_input_files("[aria-label='file of parameters to load']", file)
    look.text(".diff li:has-text('gains.kp') .reason", "out of bounds")
    look.text(".diff li:has-text('gains.old') .reason", "unknown parameter")
    assert gains.locator(".diff li.bad input:enabled").count() == 0
    gains.uncheck("[aria-label='gains.exact to true']")
    gains.click(".diff .apply")
    look.text("#parameter-panel .applied", "Applied 1 value")
    assert station.store.values()["gains.laps"] == 7
    assert station.store.values()["gains.exact"] is False


def test_the_history_restores_and_a_flight_is_marked_and_taken_back(
    gains: Any, look: Any, site: Any, station: Any
) -> None:
    history = ParameterHistory(Catalogue(site.data).engine, "quad1")
    now_ns = time.time_ns()
    history.begin_flight("run9", now_ns)
    for k in range(5):  # one gesture
        step = ("gains.kp", 4.0 + k, 5.0 + k, "ben", now_ns + k * 10**8, now_ns + k, "run9", 50 + k)
        history.add([RecordedChange(*step)])
    change(gains, {"gains.kp": 9.0})
    look.value(CELL, "9")
    gains.click("#parameter-views >> text=History")
    look.text("#parameter-panel .timeline li:first-child .change", "gains.kp 4 → 9")
    look.text("#parameter-panel .timeline li:first-child .facts", "ben · in flight · 5 values")
    gains.click("#parameter-panel [aria-label='restore gains.kp to 4']")
    gains.click("#parameter-views >> text=History")
    look.value(CELL, "4")

    change(gains, {"gains.kp": 9.0})
    open_again(gains)  # every page knows what changed in this flight
    look.has_class(KP, "flown")
    gains.click("#parameter-views >> text=Changes since take-off")
    look.text(".diff h2", "Back to before this flight")
    look.text(".diff li .values", "9 → 4 1/s²")
    gains.click(".diff .apply")
    look.value(CELL, "4")
    look.has_no_class(KP, "flown")
    history.end_flight(time.time_ns())
