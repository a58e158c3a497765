"""The page without a browser: what a person reads on it."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from vehicle_link.parameters.change import ParameterChange

TAKE_OFF = "#behaviors button:text-is('Take off')"


@pytest.fixture
def shown(kept_page: Any, flying: Any) -> Any:
    """Return a page for tests that change only what the vehicle says."""
    return kept_page


@pytest.fixture
def seen(shown: Any, look_at: Any) -> Any:
    return look_at(shown)


def test_a_link_signs_in_once(context: Any, site: Any, page: Any) -> None:
    assert page.url == f"{site.base}/"
    stranger = context.another()
    late = stranger.new_page()
    late.goto(f"{site.base}/?token=used")
    assert "no longer valid" in late.text_content("h1")
    assert "newest link" in late.text_content("main")
    stranger.close()


def test_the_bar_shows_what_the_vehicle_says(seen: Any) -> None:
    seen.text("#doing", "^FLYING")
    seen.text("#behavior", "^hover$")
    seen.text("#link", "ms · 2.0 %")
    seen.text("#battery", "^15.6 V$")
    seen.text("#tracker", "^100 Hz$")
    seen.text("#tick", "^140 µs · 0.0 %$")
    seen.text("#recording", r"^● 00:12\s+84\sMB$")
    seen.text("#flags", "not real time")


def test_poses_that_the_vehicle_refuses_show_where_the_tracker_does(
    seen: Any, station: Any, flying: Any
) -> None:
    seen.text("#tracker", "^100 Hz$")
    station.said = {"flags": ["measurements_refused"]}
    seen.text("#tracker", "^100 Hz · refused$")
    seen.has_class("#tracker", "warn")
    station.said = {"flags": ["measurements_refused", "tracker_jumped"]}
    seen.text("#tracker", "^100 Hz · jumped$")
    seen.text("#flags", "tracker jumped")
    seen.text("#table tbody", "poses used.*poses refused.*NIS")
    station.said = {}
    seen.text("#tracker", "^100 Hz$")
    seen.has_no_class("#tracker", "warn")


def test_who_flies_is_said_in_words_and_only_the_microcontroller_alone_in_red(
    page: Any, look: Any, station: Any
) -> None:
    look.text("#control-mode", "^direct$")
    look.has_no_class("#control-mode", "warn|alarm")
    station.said = {"control_mode": "near_hovering", "behavior": "near_hovering"}
    look.text("#control-mode", "^near-hovering$")
    look.has_class("#control-mode", "warn")
    station.said = {"mode": "emergency_land", "control_mode": "emergency"}
    look.text("#control-mode", "^⚠ emergency$")
    look.has_class("#control-mode", "alarm")
    look.text("#behavior", "^lands alone$")
    alone = "^the microcontroller lands alone; only Cut is obeyed"
    look.text("#flags .alone", alone)
    look.text("#emergency-state", f"{alone}$")
    page.click("#emergency-land")
    look.text("#emergency-state", rf"{alone} · acknowledged after [\d.]+ s$")
    station.said = {"mode": "emergency_land", "behavior": "land"}
    look.text("#emergency-state", "^landing under control; only Cut is obeyed · acknowledged")
    look.has_no_class("#emergency-state", "alone")
    station.said = {"mode": "emergency_land", "control_mode": "emergency"}
    page.goto(page.url + "kill")
    look.text("#state", f"^emergency land: {alone[1:]}$")
    look.text("#answer", "^landing, acknowledged after")
    look.text("#emergency-land", "may drift")


def test_what_is_old_is_grey_and_keeps_its_last_value(shown: Any, seen: Any, flying: Any) -> None:
    x = "#table tbody tr >> nth=0 >> td >> nth=1"
    seen.text("#doing", "^FLYING")
    seen.text(x, r"^1\.000$")
    flying(False)
    seen.has_class("#behavior", "stale")
    seen.text("#behavior", "^hover$")
    seen.text("#doing", "^NO CONTACT$")
    seen.has_class("#table tbody tr >> nth=0", "stale")
    seen.text(x, r"^1\.000$")
    shown.wait_for_selector("#contact:not([hidden])")
    seen.text("#flags", "^$")
    flying(True)
    shown.wait_for_selector("#contact", state="hidden")
    seen.has_no_class("#behavior", "stale")


def test_the_state_table_shows_numbers_and_ages(seen: Any) -> None:
    seen.text("#table tbody tr >> nth=0 >> td >> nth=3", r"^1\.500$")
    seen.text("#table tbody tr >> nth=5 >> td >> nth=3", r"^500\.0$")  # tracking error, z
    seen.text("#table tbody tr >> nth=0 >> td.age", r"ms$")


def test_pinned_values_stand_on_top_and_stay_while_the_rest_is_folded(shown: Any) -> None:
    first = "#table tbody tr:first-child"
    assert shown.is_disabled(f"{first} .pin")
    shown.click("#table th >> nth=0 >> text=Pin")
    shown.click("#table tbody tr:nth-child(6) .pin")  # tracking error
    shown.wait_for_selector(f"{first}.pinned")
    assert shown.inner_text(f"{first} .pin") == "tracking error"
    shown.click("#table th button")
    shown.wait_for_selector("body.folded:not(.bare)")
    kept = shown.evaluate("localStorage.getItem('quadlab.values')")
    assert kept == '{"pins":["tracking error"],"folded":true}'
    shown.click("#table th button")
    shown.click(f"{first} .pin")
    shown.wait_for_selector("body.bare:not(.folded)")
    assert shown.inner_text(f"{first} .pin") == "position"


def test_a_refusal_is_shown_with_its_reason(shown: Any, seen: Any, station: Any) -> None:
    station.refusal = "take_off refused: the motors are off; arm the vehicle first"
    shown.click(TAKE_OFF)
    seen.text("#answer", "the motors are off; arm the vehicle first")
    shown.fill("#behaviors input >> nth=0", "99")
    shown.click(TAKE_OFF)
    seen.text("#answer", "height = 99; allowed 0.2 to 20 m")


def test_the_page_comes_back_by_itself_after_a_restart_of_web(
    open_page: Any, until: Any, serve: Any, tmp_path: Path
) -> None:
    catalogue = Catalogue(tmp_path)
    with serve(tmp_path, catalogue) as first:
        page = open_page(first)
        port = int(first.host.split(":")[1])
    page.wait_for_selector("#contact[data-cause=page]")
    with serve(tmp_path, catalogue, port=port) as again:
        page.wait_for_selector("#contact:not([data-cause=page])", state="attached")

        def flies() -> bool:
            again.station.fly()  # again, as a vehicle does: a status ages on a slow page
            return bool(page.text_content("#doing").startswith("FLYING"))

        until(flies)
        page.close()
    catalogue.close()


def test_an_oscillation_is_amber_with_its_cause_and_one_press_takes_the_change_back(
    page: Any, look: Any, station: Any
) -> None:
    look.text("#doing", "^FLYING")
    look.text("#in-words", "no warnings$")
    assert page.is_hidden("#restore")
    for old, new in ((4.0, 9.0), (9.0, 13.5)):
        station.store.set({"gains.kp": new})
        revision = station.store.revision
        station.reactions.changed(
            ParameterChange(time.time_ns(), "gains.kp", old, new, "ann", revision, 1)
        )
    look.text("#in-words", "no warnings$")
    station.said = {"flags": ["oscillating"], "oscillation_axis": 1, "oscillation_frequency": 0.71}
    look.text("#doing", "^OSCILLATING$")
    look.text("#in-words", "oscillating in y at 0.7 Hz after kp 4 → 13.5$")
    assert page.get_attribute("#bar", "data-tone") == "caution"
    look.text("#restore", "^Restore kp = 4$")
    page.click("#restore")
    look.text("#in-words", "oscillating in y at 0.7 Hz$")
    assert station.store.get("gains.kp") == 4.0
    station.said = {}
    look.text("#in-words", "no warnings$")
    assert page.is_hidden("#restore")
