"""Titles of runs by the page's routes, and what has to be set to fly a run again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.titles import store_title
from flight_log import LogWriter
from flight_log.run_folder import STATION
from tests.support.runs import run_entry
from tests.waiting import wait_for

RUN, OLD = "20260201T093042Z_quad1", "20260201T083042Z_quad1"
VALUES = {"estimation.pose_gate": 7.0, "safety.landing_support": 0.2, "simulator.wind": 3.0}


@pytest.fixture(scope="module")
def flown(beacon_site: Any) -> Iterator[Catalogue]:
    """Yield the catalogue with a judged run, and with an older one whose log has no parameters."""
    catalogue = Catalogue(Path(beacon_site.data))
    parameters = {"vehicle": VALUES, "station": {"station.bearings.layout": "cube8"}}
    for run_id, attached in (
        (RUN, {"parameters.json": json.dumps(parameters).encode()}),
        (OLD, {}),
    ):
        catalogue.add(run_entry(run_id, file=run_id))
        (catalogue.folder / run_id).mkdir()
        with LogWriter(catalogue.folder / run_id / STATION, {"vehicle": "quad1"}, attached) as log:
            log.write(
                "/quad1/marks", "std_msgs/String", b"\x00\x01\x00\x00\x01\x00\x00\x00\x00", 1, 1
            )
    report = catalogue.folder / RUN / "report"
    report.mkdir()
    result = {
        "experiment": "figure_eight",
        "verdict": "passed",
        "options": {"laps": 4},
        "metrics": {"position_rms_m": 0.00213},
    }
    (report / "result.json").write_text(json.dumps(result))
    yield catalogue
    catalogue.close()


@pytest.fixture(scope="module")
def person(beacon_site: Any) -> Iterator[httpx.Client]:
    def is_known() -> bool:
        beacon_site.station.fly()
        return bool(client.get("/api/parameters").json().get("parameters"))

    with beacon_site.sign_in() as client:
        wait_for(is_known)
        yield client


def line(person: httpx.Client, run_id: str = RUN) -> dict[str, Any]:
    return next(run for run in person.get("/api/runs").json() if run["id"] == run_id)


def test_the_list_has_titles_verdicts_and_errors(flown: Catalogue, person: httpx.Client) -> None:
    store_title(flown, RUN, "Kp_xy 4 → 5")
    shown = {name: line(person)[name] for name in ("title", "title_by", "verdict", "rms")}
    assert shown == {
        "title": "Figure 8, kp_xy 4 → 5",
        "title_by": "",
        "verdict": "passed",
        "rms": 0.00213,
    }
    store_title(flown, RUN, "Figure 8 × 1, kp_xy 4 → 5")
    assert line(person)["title"] == "Figure 8 × 1, kp_xy 4 → 5"
    assert (line(person, OLD)["title"], line(person, OLD)["rms"]) == ("", None)


def test_a_title_is_written_and_taken_back(flown: Catalogue, person: httpx.Client) -> None:
    path = f"/api/runs/{RUN}/title"
    written = person.put(path, json={"title": "the windy one"}).json()
    assert written["title"] == line(person)["title"] == "the windy one"
    assert written["title_by"]
    assert person.put(path, json={"title": ""}).json()["title"].startswith("Figure 8")
    refused = person.put(path, json={"title": "x" * 121})
    assert (refused.status_code, refused.json()["error"].count("121 characters")) == (422, 1)
    assert person.put("/api/runs/none/title", json={"title": "x"}).status_code == 404


def test_a_run_is_flown_again_with_its_gains_beacons_and_options(
    flown: Catalogue, person: httpx.Client
) -> None:
    found = person.get(f"/api/runs/{RUN}/again").json()
    assert (found["experiment"], found["options"]) == ("figure_eight", {"laps": 4})
    changed = {one["name"]: (one["new"], one["reason"]) for one in found["lines"]}
    assert changed["estimation.pose_gate"] == (7.0, "")
    assert not changed.keys() & {"safety.landing_support", "simulator.wind"}
    assert found["same"] + len(changed) == 2


def test_a_run_without_parameters_says_so_in_one_line(
    flown: Catalogue, person: httpx.Client
) -> None:
    answer = person.get(f"/api/runs/{OLD}/again")
    assert answer.status_code == 404
    assert "cannot be flown again: its log has no parameters" in answer.json()["error"]
