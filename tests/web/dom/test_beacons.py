"""Beacons tab: it shows what station and vehicle confirmed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from tests.support.runs import run_entry

LAYOUT = "station.bearings.layout"
CELLS = "#beacons-layout tbody input"
FLIGHT = "20260130T093042Z_quad1"
FOURTH = ".residual[data-id='4']"


@pytest.fixture
def site(beacon_site: Any) -> Iterator[Any]:
    yield beacon_site
    station = beacon_site.station
    station.compared, station.residuals = True, None
    station.refusal = ""
    defaults = {one.name: one.default for one in station.store.descriptions()}
    changed = {n: v for n, v in defaults.items() if station.store.values()[n] != v}
    if changed:  # by the page's interface, so that the next page does not begin with the old ones
        with beacon_site.sign_in() as admin:
            answer = admin.put("/api/parameters", json={"values": changed})
            assert answer.status_code == 200, answer.text


@pytest.fixture
def tab(page: Any) -> Any:
    return opened(page)


def opened(page: Any) -> Any:
    page.click("[data-tab=beacons]")
    page.wait_for_selector(FOURTH)
    return page


def values(station: Any) -> dict[str, Any]:
    return dict(station.store.values())


def test_a_beacon_whose_bearings_are_off_is_marked_with_its_mean_offset(
    tab: Any, look: Any, station: Any
) -> None:
    look.has_no_class(".residual[data-id='2']", "off")
    off = {"flags": ["on_bearings", "beacon_off"], "suspect_offset": 0.0733}
    station.said = {**off, "suspect_beacon": 2, "suspect_left_out": True}
    look.has_class(".residual[data-id='2']", "off")
    look.has_no_class(".residual[data-id='1']", "off")
    look.text("#beacons-residuals .offset", r"^Beacon 2 is 4\.2°.*left out")
    station.said = {**off, "suspect_beacon": -1}
    look.has_no_class(".residual[data-id='2']", "off")
    look.text("#beacons-residuals .offset", r"^One beacon is 4\.2°")
    station.said = {}
    tab.wait_for_selector("#beacons-residuals .offset", state="hidden")


# ---------------------------------------------------------------------- the layout
def test_a_refused_layout_says_why_and_the_table_shows_what_is_confirmed(
    tab: Any, look: Any, station: Any
) -> None:
    look.value(f"{CELLS} >> nth=1", "1.000")
    tab.fill(f"{CELLS} >> nth=1", "1.4")
    look.has_class(f"{CELLS} >> nth=1", "draft")
    station.refusal = f"{LAYOUT} not changed, refused by the vehicle: it flies on bearings"
    tab.click("#beacons-layout button:has-text('Apply')")
    look.text("#beacons-layout .reason", "refused by the vehicle: it flies on bearings")
    look.value(f"{CELLS} >> nth=1", "1.000")
    look.has_no_class(f"{CELLS} >> nth=1", "draft")
    station.refusal = ""
    tab.click("#beacons-layout button:has-text('Edit again')")
    look.value(f"{CELLS} >> nth=1", "1.4")
    tab.press(f"{CELLS} >> nth=1", "Enter")
    look.value(f"{CELLS} >> nth=1", "1.400")
    assert values(station)[LAYOUT].startswith("1 1.4 1.0 0.1;")


def test_fewer_than_four_beacons_are_refused(tab: Any, look: Any, station: Any) -> None:
    tab.click("#beacons-layout .remove >> nth=3")
    tab.click("#beacons-layout button:has-text('Apply')")
    look.text("#beacons-layout .reason", "3 beacons; allowed are 4 to 32: add 1")
    assert tab.locator("#beacons-layout tbody tr").count() == 4
    assert values(station)[LAYOUT] == "paper"


def test_beacons_are_added_and_presets_chosen_on_every_page(
    tab: Any, look: Any, station: Any, site: Any, open_page: Any, look_at: Any
) -> None:
    other = opened(open_page(site))
    tab.click("#beacons-layout button:has-text('Add beacon')")
    look.value(f"{CELLS} >> nth=16", "5")
    look_at(other).value("#beacons-layout select", "paper")
    tab.click("#beacons-layout button:has-text('Apply')")
    look_at(other).value(f"{CELLS} >> nth=16", "5")
    look_at(other).value("#beacons-layout select", "")
    other.select_option("#beacons-layout select", "eight")
    look.value("#beacons-layout select", "eight")
    tab.wait_for_selector(".residual[data-id='8']")
    assert values(station)[LAYOUT] == "eight"
    other.close()


# ---------------------------------------------------------------------- onto bearings
def test_the_way_onto_bearings_and_back(tab: Any, look: Any, station: Any) -> None:
    look.text("#beacons-session .flies", "^Flies on the tracker's poses$")
    look.has_class("#beacons-session .steps li >> nth=0", "done")
    over = "#beacons-session button:has-text('Fly on bearings')"
    look.text("#beacons-session .steps li >> nth=3", "^Hand over, run it in parallel first")
    assert not tab.is_enabled(over)
    tab.click("#beacons-session button:has-text('Run in parallel')")
    look.has_class("#beacons-session .steps li >> nth=1", "done")
    now = values(station)
    assert now["estimation.shadow"] == "error_state"
    assert now["estimation.shadow_source"] == "bearings"
    figures = {"shadow_deviation": 0.21, "shadow_distance": 0.034}
    station.said = {"shadow_lack": 2, "shadow_share": 0.7, **figures}
    look.text("#beacons-session .convergence", "^σ 210 mm · 34 mm apart · converging$")
    look.text("#beacons-session .steps li >> nth=3", "^Hand over, converging")
    assert not tab.is_enabled(over)
    look.text("#beacons-errors tfoot", "^error-stateon board34from the vehicle's estimate$")
    station.said = {"shadow_lack": 4, "shadow_share": 1.0, "shadow_ready": 4.2, **figures}
    look.text("#beacons-session .convergence", "ready for 4 s$")
    look.has_class("#beacons-session .convergence", "done")
    look.text("#beacons-session .steps li >> nth=3", "^Hand over, it has converged")
    station.refusal = "estimator error_state on bearings has not converged: 0.3 s of 2 s"
    tab.click("#beacons-session button:has-text('Fly on bearings')")
    look.text("#beacons-session .reason", "has not converged")
    assert values(station)["estimation.source"] == "poses"
    station.refusal = ""
    tab.click("#beacons-session button:has-text('Fly on bearings')")
    look.text("#beacons-session .flies", "^Flies on bearings to the beacons$")
    look.text("#beacons-session .detail", "^error-state$")
    look.text(
        "#beacons-layout .facts", "^Beacons cannot be moved while .* Press Back to tracker first"
    )
    assert tab.locator("#beacons-layout fieldset:disabled").count() == 1
    tab.click("#beacons-session button:has-text('Back to tracker')")
    look.text("#beacons-session .flies", "^Flies on the tracker's poses$")
    tab.wait_for_selector("#beacons-layout fieldset:enabled")


def test_a_preset_of_gains_goes_with_the_complementary_filter(
    tab: Any, look: Any, station: Any
) -> None:
    tab.select_option("#beacons-session select >> nth=0", "complementary")
    tab.select_option("#beacons-session select >> nth=1", "bearings")
    tab.click("#beacons-session button:has-text('Run in parallel')")
    look.text("#beacons-session .detail", "complementary · bearings gains")
    assert values(station)["estimation.position_bandwidth"] == 2.5


# ---------------------------------------------------------------------- sensor and view
def test_the_sensors_rows_are_parameters_as_everywhere(tab: Any, look: Any, station: Any) -> None:
    tab.click("#beacons-sensor summary >> nth=0")
    cell = "#beacons-sensor input[aria-label='station.bearings.sigma, value']"
    tab.fill(cell, "0.75")
    tab.press(cell, "Enter")
    look.text("#beacons-sensor summary >> nth=0", "1 modified")
    assert values(station)["station.bearings.sigma"] == 0.75
    tab.click("[data-tab=gains]")
    tab.fill("#search", "bearings.sigma")
    look.value("#gains input[aria-label='station.bearings.sigma, value']", "0.75")
    tab.fill("#search", "")


def test_the_view_is_shared(
    tab: Any, site: Any, open_page: Any, until: Callable[..., None]
) -> None:
    other = opened(open_page(site))
    box = "#beacons-view input[data-view='rays']"
    for one in (tab, other):
        until(lambda one=one: one.is_checked(box))  # the view is there, with its default
    tab.click(box)
    for one in (tab, other):
        until(lambda one=one: not one.is_checked(box))
    other.click(box)
    for one in (tab, other):
        until(lambda one=one: one.is_checked(box))
    other.close()


# ---------------------------------------------------------------------- a survey
def test_a_surveyed_layout_is_shown_with_its_residuals_and_set_when_accepted(
    page: Any, site: Any, look: Any, station: Any
) -> None:
    (Path(site.data) / "runs" / f"{FLIGHT}.mcap").write_bytes(b"a log")
    Catalogue(site.data).add(run_entry(FLIGHT, start_ns=1, bytes=5))
    tab, rows = opened(page), "#beacons-survey tbody tr"
    tab.select_option("#beacons-survey select", FLIGHT)
    tab.click("#beacons-survey button >> text=Survey")
    look.text(f"{rows} >> nth=0", "^1 *1.020 *0.980 *0.100 *20, -20, 0 *–$")
    look.text("#beacons-survey .empty", "5.20 mrad rms with the flight's layout, 1.30 mrad")
    assert values(station)[LAYOUT] == "paper"
    tab.click("#beacons-survey button >> text=Accept")
    look.text("#beacons-survey .said", "Accepted. It is the layout in use")
    look.value(f"{CELLS} >> nth=1", "1.020")
    assert tab.is_hidden("#beacons-survey button >> text=Accept")
