"""The way from a row of a campaign to its replay, in Chromium."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from extensions.campaigns.flights import fly_task
from extensions.campaigns.tests.conftest import Bench

TAB = "#campaigns"
FLOWN = 240.0
"""s within which a new process has flown on a busy computer."""
CASES = 'experiment = "cases.py"\nseeds = 2\n[factors]\n"experiment.case" = ["good", "fails"]\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, serve: Any) -> Iterator[Any]:
    """Yield a site with a campaign of very short flights of the whole stack."""
    data = tmp_path_factory.mktemp("again")
    Bench(data, None).flown(CASES, "campaigns/cases")  # type: ignore[arg-type]
    with serve(data, Catalogue(data)) as running:
        yield running


def test_a_row_that_failed_is_flown_again_and_its_replay_opens(open_page: Any, site: Any) -> None:
    """The run is, byte for byte, the flight of the worker."""
    from extensions.campaigns.folder import CampaignFolder

    page = open_page(site)
    page.click("[data-tab=experiments]")
    page.click(f"{TAB} summary")
    page.click(f"{TAB} .rows button >> nth=0")
    row = page.locator(f"{TAB} .rows li >> nth=0")
    index = int(row.locator("b").text_content())
    assert row.locator("pre").text_content().startswith("quadlab fly ")
    row.get_by_role("button", name="Fly again").click()
    page.wait_for_url(f"**/replay/cases_{index:07}", timeout=1e3 * FLOWN)
    folder = CampaignFolder(site.data / "campaigns" / "cases")
    (flown,) = fly_task(folder.task([index], keep_logs=True))
    assert flown.verdict == "failed"
    run = site.data / "runs" / f"cases_{index:07}" / "station.mcap"
    assert run.read_bytes() == flown.log
