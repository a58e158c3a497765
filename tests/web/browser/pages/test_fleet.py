"""Page with two vehicles: the line to switch between them, and the fleet view."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import tidy_runs

PERIOD = 0.1  # s
RUN = "20260131T093042Z_quad1"


@pytest.fixture(scope="module")
def fleet_site(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    data, ended = tmp_path_factory.mktemp("fleet"), threading.Event()
    catalogue = Catalogue(data)
    write_run(data / "runs" / f"{RUN}.mcap", MadeRun(2.0))
    tidy_runs(catalogue)
    with serve(data, catalogue, vehicles=("quad1", "quad2")) as running:
        first, second = running.stations
        second.said = {"armed": False, "airborne": False, "mode": "ready", "behavior": "ground"}

        def fly() -> None:
            while not ended.wait(PERIOD):
                first.fly(1.0, 0.5, 1.2)
                second.fly(-1.0, -0.5, 0.0)

        thread = threading.Thread(target=fly, daemon=True)
        thread.start()
        yield running
        ended.set()
        thread.join()


@pytest.fixture
def page(fleet_site: Any, chromium: Any) -> Iterator[Any]:
    with fleet_site.sign_in() as admin:
        context = chromium.new_context(viewport={"width": 1600, "height": 900})
        context.add_cookies(fleet_site.cookies_of(admin))
        page = context.new_page()
        problems: list[str] = []
        page.on("pageerror", lambda error: problems.append(str(error)))
        yield page
        context.close()
        assert problems == []


def test_the_switch_keeps_the_tab_and_takes_all_of_the_page_along(
    fleet_site: Any, page: Any, look: Any
) -> None:
    page.goto(fleet_site.base)
    look.text("#vehicle-strip [aria-current]", "quad1flying15.6 V")
    look.text("#vehicle-strip .vehicle:last-child", "quad2motors off15.6 V")
    look.text("#charts .legend >> nth=0", "x1.000y0.500z1.200")
    page.locator("#open-gains").click()
    page.keyboard.press("v")
    page.keyboard.press("Enter")
    look.text("#vehicle", "^quad2$")
    assert page.evaluate("location.pathname") == "/v/quad2/"
    look.text("[role=tab][aria-selected=true]", "Gains")
    look.text("#charts .legend >> nth=0", "x−1.000y−0.500z0.000")
    look.text("#doing", "^MOTORS OFF$")
    with page.expect_response("**/v/quad2/api/commands/emergency"):
        page.locator("#emergency-land").click()
    asked = [[service for service, _ in one.requests] for one in fleet_site.stations]
    assert asked == [[], ["emergency"]]
    page.go_back()
    look.text("#vehicle", "^quad1$")
    look.text("#charts .legend >> nth=0", "x1.000y0.500z1.200")
    page.go_forward()
    look.text("#vehicle", "^quad2$")
    page.locator("nav .pages a").first.click()
    page.wait_for_url("**/v/quad2/runs")
    look.text("#head #vehicle", "quad2")


@pytest.mark.parametrize("path", ["/setup", "/runs", f"/replay/{RUN}"])
def test_the_line_of_vehicles_is_above_what_a_page_shows(
    fleet_site: Any, page: Any, look: Any, path: str
) -> None:
    page.goto(f"{fleet_site.base}/v/quad2{path}")
    look.text("#vehicle-strip [aria-current]", "quad2motors off")
    bottom, top, width = page.evaluate("""() => {
        const box = (css) => document.querySelector(css).getBoundingClientRect();
        return [box('#vehicle-strip').bottom, box('main').top, box('#vehicle-strip').width]
    }""")
    assert (bottom <= top, width) == (True, 1600)
    ids = page.evaluate("[...document.querySelectorAll('[id]')].map(({ id }) => id)")
    assert len(ids) == len(set(ids))
    if path == "/setup":
        look.text("#vehicles tbody tr >> nth=1", "quad2 *good *ready")


def test_the_fleet_view_shows_all_and_lands_all(fleet_site: Any, page: Any, look: Any) -> None:
    for station in fleet_site.stations:
        station.requests.clear()
    page.goto(f"{fleet_site.base}/fleet")
    look.text("tbody tr:nth-child(1)", "quad1.*flying.*hover.*good.*15.6 V.*1.20 m")
    look.text("tbody tr:nth-child(2)", "quad2.*motors off.*ready.*0.00 m")
    page.locator("#land-all").click()
    look.text("#land-all-state", "✓ quad1 landing")
    look.hold(
        "#emergency-land-all",
        lambda: any(service == "emergency" for service, _ in fleet_site.stations[0].requests),
    )
    look.text("#land-all-state", "of 1 landing · 1 with motors off")
    fleet_site.stations[0].said = {"mode": "emergency_land", "behavior": "land"}
    look.text("#land-all-state", "✓ 1 of 1 landing · 1 with motors off")
    look.text("tbody tr:nth-child(1) .emergency", "landing ✓ after")
    asked = [[service for service, _ in one.requests] for one in fleet_site.stations]
    assert asked == [["start_behavior", "emergency"], []]
