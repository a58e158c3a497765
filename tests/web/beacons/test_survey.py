"""A survey proposes a layout; an accepted one is set like any other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from bearing_sim.beacons import parse_layout
from console.catalogue.catalogue import Catalogue
from tests.support.runs import run_entry
from tests.support.survey import OTHER, PLACES
from web.parameters.replica import LAYOUT

GOOD, WORSE, ELSE = (f"2026013{k}T093042Z_quad1" for k in (0, 1, 2))
PLACE = "/api/beacons/survey"
Until = Callable[..., None]


@pytest.fixture
def site(beacon_site: Any, until: Until) -> Iterator[Any]:
    """Yield a site with its parameters read, the paper's beacons in use, and three runs."""
    catalogue = Catalogue(beacon_site.data)
    for name, content in ((GOOD, b"a log"), (WORSE, b""), (ELSE, OTHER)):
        path = Path(beacon_site.data) / "runs" / f"{name}.mcap"
        if not path.exists():
            path.write_bytes(content)
            catalogue.add(run_entry(name, start_ns=1, bytes=len(content)))
    station = beacon_site.station
    station.fly()
    with beacon_site.sign_in() as client:

        def read() -> bool:
            station.fly()
            return bool(client.get("/api/beacons").json()["layout"])

        until(read)
        client.put("/api/beacons", json={"preset": "paper"})
    yield beacon_site
    station.refusal = ""


def surveyed(client: httpx.Client, run: str, until: Until) -> dict[str, Any]:
    """Survey a run and return the result."""
    answer = client.post(PLACE, json={"run_id": run})
    assert answer.status_code == 200, answer.text
    until(lambda: client.get(PLACE).json()["state"] in ("ready", "failed"), 60.0)
    found: dict[str, Any] = client.get(PLACE).json()
    return found


def test_a_proposal_changes_nothing_until_an_operator_accepts_it(
    site: Any, operator: httpx.Client, until: Until
) -> None:
    found = surveyed(operator, GOOD, until)
    assert (found["state"], found["run_id"], found["decision"]) == ("ready", GOOD, "")
    proposal = found["proposal"]
    assert (proposal["before"], proposal["after"]) == (5.2, 1.3)
    first = proposal["beacons"][0]
    assert first == {
        "id": 1,
        "position": [1.02, 0.98, 0.1],
        "moved": [20, -20, 0],
        "deviation": None,
    }
    assert site.station.store.values()[LAYOUT] == "paper"
    accepted = operator.post(f"{PLACE}/accept")
    assert accepted.json()["decision"] == "accepted"
    layout = parse_layout(str(site.station.store.values()[LAYOUT]))
    assert (
        dict(zip(layout.ids.tolist(), map(tuple, layout.positions_w.tolist()), strict=True))
        == PLACES
    )
    again = operator.post(f"{PLACE}/accept")
    assert again.status_code == 409
    assert "is accepted already" in again.json()["error"]


def test_a_rejected_one_changes_nothing(site: Any, operator: httpx.Client, until: Until) -> None:
    surveyed(operator, GOOD, until)
    assert operator.post(f"{PLACE}/reject").json()["decision"] == "rejected"
    assert site.station.store.values()[LAYOUT] == "paper"
    assert operator.post(f"{PLACE}/accept").status_code == 409


def test_one_that_the_vehicle_refuses_stays_open(
    site: Any, operator: httpx.Client, until: Until
) -> None:
    surveyed(operator, GOOD, until)
    site.station.refusal = "the vehicle flies on them"
    answer = operator.post(f"{PLACE}/accept")
    assert (answer.status_code, answer.json()["error"]) == (409, "the vehicle flies on them")
    site.station.refusal = ""
    assert operator.get(PLACE).json()["decision"] == ""


def test_one_that_fits_no_better_or_is_of_other_beacons_is_refused(
    site: Any, operator: httpx.Client, until: Until
) -> None:
    found = surveyed(operator, WORSE, until)
    assert (found["state"], found["proposal"]) == ("failed", None)
    assert "no layout that fits better: 5.2 instead of 5.1" in found["reason"]
    assert "survey a flight first" in operator.post(f"{PLACE}/accept").json()["error"]
    surveyed(operator, ELSE, until)
    answer = operator.post(f"{PLACE}/accept")
    assert answer.status_code == 409
    assert "of beacons 11, 12, 13, 14, but those in use are 1, 2, 3, 4" in answer.json()["error"]
    unknown = operator.post(PLACE, json={"run_id": "nothing"})
    assert not unknown.is_success
    assert "nothing" in unknown.json()["error"]
