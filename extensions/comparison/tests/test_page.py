"""The comparison on the Beacons tab."""

from __future__ import annotations

from typing import Any

import pytest

from tests.web.dom.test_beacons import FOURTH, opened, site, values

__all__ = ["site"]
COMPARED = "station.comparison.estimators"


@pytest.fixture
def tab(page: Any) -> Any:
    opened(page).wait_for_selector("#beacons-errors .estimate")
    return page


def test_a_beacon_that_is_not_seen_is_grey_and_keeps_its_last_value(
    tab: Any, look: Any, station: Any
) -> None:
    station.residuals = {1: 0.01, 2: 0.02, 3: 0.03, 4: 0.03927}
    look.text(f"{FOURTH} output", r"^2\.25°$")
    station.residuals = {1: 0.01, 2: 0.02, 3: 0.03}
    look.has_class(FOURTH, "stale")
    look.text(f"{FOURTH} output", r"^2\.25°$")
    look.has_no_class(".residual[data-id='1']", "stale")


def test_without_a_comparison_all_of_it_is_grey(tab: Any, look: Any, station: Any) -> None:
    look.has_no_class("#beacons-errors table", "stale")
    station.compared = False
    look.has_class("#beacons-errors table", "stale")
    look.has_class(FOURTH, "stale")
    look.text("#beacons-errors tbody tr >> nth=0 >> td >> nth=2", "^20$")
    station.compared = True
    look.has_no_class("#beacons-errors table", "stale")


def test_estimators_have_a_row_each_and_the_one_chosen_is_the_ghost(
    tab: Any, look: Any, station: Any
) -> None:
    box = tab.locator("#beacons-errors input[data-name='error_state']")
    box.click()
    look.text("#beacons-errors tbody tr >> nth=1 >> td >> nth=2", "^21$")
    assert values(station)[COMPARED] == "error_state"
    tab.click(".estimate[data-name='error_state']")
    look.text("#beacons-residuals h2", "of error-state")
    look.value("#beacons-view .ghost select", "error_state")
    look.text("#beacons-chart .legend", "vehicle.*error-state.*bound of one frame")
    tab.locator("#beacons-errors input[data-name='complementary:paper']").click()
    look.text("#beacons-errors tbody tr >> nth=2 >> td >> nth=0", "complementarypaper gains")
    assert values(station)[COMPARED] == "error_state complementary:paper"
    box.click()
    look.text("#beacons-errors tbody tr >> nth=1 >> td >> nth=0", "complementarypaper gains")
    assert values(station)[COMPARED] == "complementary:paper"


def test_a_refused_estimator_says_why_and_stays_unchecked(
    tab: Any, look: Any, station: Any
) -> None:
    station.refusal = "estimators: the station is too busy"
    box = tab.locator("#beacons-errors input[data-name='error_state']")
    box.click()
    look.text("#beacons-errors .reason", "the station is too busy")
    assert not box.is_checked()
