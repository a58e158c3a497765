"""Campaigns on the Fly tab: the list, the drawings of one, and the commands of its rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from extensions.campaigns.tests.conftest import COMPILED, Bench
from tests.web.conftest import Site, serving, until
from tests.web.dom.conftest import context, dom, open_page

__all__ = ["context", "dom", "open_page", "until"]

TAB = "#campaigns"


@pytest.fixture(scope="module")
def campaign_site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """Yield a site with two campaigns in its data folder."""
    data = tmp_path_factory.mktemp("campaigns")
    bench = Bench(data, None)  # type: ignore[arg-type]
    bench.flown(COMPILED, "campaigns/plain")
    bench.flown(
        'experiment = "cases.py"\nseeds = 2\n'
        '[factors]\n"experiment.height" = [1.0, 2.0]\n"experiment.case" = ["good", "fails"]\n',
        "campaigns/cases",
    )
    with serving(data, Catalogue(data)) as running:
        yield running


def test_a_click_on_a_row_shows_the_command_that_flies_it_again(
    open_page: Any, campaign_site: Site
) -> None:
    tab = open_page(campaign_site)
    tab.click(f"{TAB} summary")
    tab.wait_for_selector(f"{TAB} .heat td")
    assert tab.locator(f"{TAB} .campaigns li").count() == 2
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
