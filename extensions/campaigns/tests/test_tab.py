"""Campaigns on the Experiments tab: the list, the drawings of one, and the commands of its rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from benchmarks.logs.recorded_run import MadeRun, write_run
from console.catalogue.catalogue import Catalogue
from console.runs.adoption import described
from extensions.campaigns.tests.conftest import COMPILED, Bench
from tests.web.conftest import Site, serving, until
from tests.web.dom.conftest import context, dom, open_page

__all__ = ["context", "dom", "open_page", "until"]

TAB = "#campaigns"
CASES = (
    'experiment = "cases.py"\nseeds = 2\n'
    '[factors]\n"experiment.height" = [1.0, 2.0]\n"experiment.case" = ["good", "fails"]\n'
)


@pytest.fixture(scope="module")
def campaign_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Yield a site with campaigns in its data folder, and a run in its catalogue."""
    data = tmp_path_factory.mktemp("campaigns")
    bench = Bench(data, None)  # type: ignore[arg-type]
    bench.flown(COMPILED, "campaigns/plain")
    bench.flown(
        CASES.replace("height", "folder").replace("1.0, 2.0", '"a", "b"'), "campaigns/others"
    )
    bench.flown(CASES.replace("[fac", '[fixed]\n"simulator.drag" = 0.1\n[fac'), "campaigns/drag")
    bench.flown(CASES, "campaigns/cases")
    catalogue = Catalogue(data)
    write_run(data / "runs" / "flown.mcap", MadeRun(2.0))
    catalogue.add(described(data / "runs" / "flown.mcap", None))
    report = data / "runs" / "flown_report"
    report.mkdir()
    (report / "result.json").write_text('{"verdict": "passed", "metrics": {"sag_v": 0.25}}')
    with serving(data, catalogue) as running:
        yield running


def test_a_click_on_a_row_shows_the_command_that_flies_it_again(
    open_page: Any, campaign_site: Site
) -> None:
    tab = open_page(campaign_site)
    tab.click("[data-tab=experiments]")
    tab.click(f"{TAB} summary")
    tab.wait_for_selector(f"{TAB} .heat td")
    assert tab.locator(f"{TAB} .campaigns li").count() == 4
    assert "8 of 8" in tab.locator(f"{TAB} .campaigns button >> nth=0").text_content()
    assert tab.locator(f"{TAB} .ecdf .curve").count() == 1
    assert [tab.locator(f"{TAB} .heat td >> nth={k}").text_content() for k in range(4)] == [
        "1",
        "2",
        "1",
        "2",
    ]
    assert tab.locator(f"{TAB} .rows .amber").count() == 4
    row = f"{TAB} .rows li >> nth=0"
    tab.click(f"{TAB} .rows button >> nth=0")
    command = tab.locator(f"{row} >> pre").text_content()
    assert command.startswith("quadlab fly ")
    assert "--set experiment.case=fails" in command
    assert tab.locator(f"{row} >> div >> button").text_content() == "Fly again"
    _drawn(tab)
    _compared(tab)


def _drawn(tab: Any) -> None:
    """Look at what the figures draw, and choose a flight in one of them."""
    assert tab.locator(f"{TAB} .effects circle").count() == 4  # two levels of two factors
    assert "experiment.height = 2: median 2" in tab.locator(f"{TAB} .effects").text_content()
    assert tab.locator(f"{TAB} .scatter circle").count() == 2 * 8  # the height and the metric
    assert tab.locator(f"{TAB} .indices").count() == 0  # of the design saltelli only
    assert tab.locator(f"{TAB} .parallel").count() == 0  # of two columns
    report = tab.locator(f"{TAB} a[target=_blank]").get_attribute("href")
    assert report == "/api/campaigns/cases/report"
    tab.evaluate(
        f"document.querySelectorAll('{TAB} .scatter circle')[3].dispatchEvent(new Event('click'))"
    )
    tab.wait_for_selector(f"{TAB} .rows li:first-child[data-index='3']")
    assert tab.locator(f"{TAB} .rows li >> nth=0 >> pre").text_content().startswith("quadlab fly")
    assert tab.locator(f"{TAB} .rows li").count() == 8  # none twice


def _compared(tab: Any) -> None:
    """Compare with a campaign that has pairs, and with one that has none."""
    assert tab.locator(f"{TAB} .against option").count() == 4
    tab.select_option(f"{TAB} .against select", "drag")
    tab.wait_for_selector(f"{TAB} .pairs tbody tr")
    assert "8 pairs" in tab.locator(f"{TAB} .pairs").text_content()
    assert "0 better, 0 worse" in tab.locator(f"{TAB} .pairs").text_content()
    tab.select_option(f"{TAB} .against select", "others")
    tab.wait_for_selector(f"{TAB} .against .reason:not([hidden])")
    assert (
        "only flights with equal factors are pairs"
        in tab.locator(f"{TAB} .against .reason").text_content()
    )


def test_trends_of_the_runs_have_a_point_for_each(open_page: Any, campaign_site: Site) -> None:
    page = open_page(campaign_site)
    page.goto(f"{campaign_site.base}/runs")
    page.wait_for_selector("#trends summary")
    page.click("#trends summary")
    page.wait_for_selector("#trends circle")
    assert page.locator("#trends a").get_attribute("href") == "/replay/flown"
    assert "0.25" in page.locator("#trends circle title").text_content()
    page.select_option('#trends select[aria-label="grouped by"]', "battery")
    page.wait_for_selector("#trends .empty:not([hidden])")
    _answered_late(page)


def _answered_late(page: Any) -> None:
    """Choose one group, then another whose answer overtakes that of the first."""
    page.evaluate(
        """() => { const real = fetch, late = new Promise((go) => { globalThis.release = go; });
        globalThis.fetch = async (path, how) => {
          const answer = await real(path, how);
          if (!String(path).includes("by=vehicle")) return answer;
          const found = await answer.json();
          await late;
          return { ok: true, json: async () => found }; }; }"""
    )
    chosen = '#trends select[aria-label="grouped by"]'
    page.select_option(chosen, "vehicle")
    page.select_option(chosen, "all")
    page.wait_for_selector("#trends circle")
    page.evaluate("() => { release(); return new Promise((done) => setTimeout(done)); }")
    assert page.locator(chosen).input_value() == "all"
