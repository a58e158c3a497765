"""The page of runs without a browser: titles, verdicts, and *Fly again*."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.titles import store_title, titles_of
from flight_log import LogWriter
from flight_log.run_folder import STATION
from tests.support.runs import run_entry
from tests.waiting import wait_for

RUN = "20260201T093042Z_quad1"
NAME = "#detail input.name"


@pytest.fixture(scope="module")
def catalogue(site: Any) -> Iterator[Catalogue]:
    """Yield the catalogue with a run that an experiment has judged."""
    made = Catalogue(Path(site.data))
    (made.folder / RUN / "report").mkdir(parents=True)
    attached = {"parameters.json": json.dumps({"vehicle": {"control.kp": 5.0}}).encode()}
    LogWriter(made.folder / RUN / STATION, {"vehicle": "quad1"}, attached).close()
    made.add(run_entry(RUN, start_ns=1_769_938_242_000_000_000, file=RUN))
    store_title(made, RUN, "Kp_xy 4 → 13")
    result = {"experiment": "hover", "verdict": "failed", "metrics": {"position_rms_m": 0.0123}}
    (made.folder / RUN / "report/result.json").write_text(json.dumps(result))
    yield made
    made.close()


@pytest.fixture
def runs_page(catalogue: Catalogue, kept_page: Any, site: Any) -> Any:
    kept_page.goto(f"{site.base}/runs")
    kept_page.wait_for_selector("#run-0 .title")
    return kept_page


def test_a_run_shows_its_title_verdict_and_error(runs_page: Any, look_at: Any) -> None:
    sees = look_at(runs_page)
    sees.text("#run-0 .title", "^Hover, kp_xy 4 → 13$")
    sees.text("#run-0 .chip.failed", "^failed$")
    sees.text("#run-0 .number >> nth=0", "^12.3 mm$")
    assert runs_page.get_attribute("#detail .links a:text-is('Fly again')", "href").endswith(
        f"/#again={RUN}"
    )


def test_a_title_is_written_over_and_comes_back_when_emptied(
    runs_page: Any, catalogue: Catalogue, until: Any
) -> None:
    for text, shown in (("the windy one", "the windy one"), ("", "Hover, kp_xy 4 → 13")):
        runs_page.fill(NAME, text)
        runs_page.keyboard.press("Enter")
        until(lambda shown=shown: runs_page.inner_text("#run-0 .title") == shown)
    assert titles_of(catalogue, [RUN])[RUN].text == "Kp_xy 4 → 13"


@pytest.mark.parametrize(
    ("run", "shown"), [(RUN, f"^Fly {RUN} again"), ("elsewhere", "is not inside")]
)
def test_a_run_to_fly_again_is_compared_first(
    runs_page: Any, site: Any, flying: Any, look_at: Any, run: str, shown: str
) -> None:
    with site.sign_in() as client:  # the vehicle's parameters are read when it is heard
        wait_for(lambda: client.get(f"/api/runs/{RUN}/again").status_code == 200)
    runs_page.goto(f"{site.base}/#again={run}")
    runs_page.wait_for_selector("#behaviors button")
    look_at(runs_page).text("#parameter-panel :is(h2, .reason[role=status]):not([hidden])", shown)
