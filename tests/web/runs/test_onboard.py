"""The vehicle's own logs on the page: listed, fetched through the station, replayed, compared."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from console.catalogue.completeness import Completeness, store_completeness
from vehicle_link.messages import header, new

RUN = "20260131T093042Z_quad1"
LOG = "quad1_20260131T093042_120Z.mcap"


@pytest.fixture
def logs(site: Any) -> Iterator[None]:
    files = [
        new(
            "quadlab_msgs/OnboardFile",
            name=LOG,
            size=7,
            identity=1,
            start_ns=5_000_000_000,
            end_ns=65_000_000_000,
            closed=True,
        ),
        new("quadlab_msgs/OnboardFile", name="quad1_torn.mcap", size=9, identity=2),
    ]
    site.station.answers["onboard_files"] = {"files": files, "free_bytes": 4_000_000_000}
    yield
    site.station.answers.clear()


@pytest.mark.usefixtures("logs")
def test_logs_on_board_are_listed_with_their_copies_here(site: Any, operator: httpx.Client) -> None:
    listed = operator.get("/api/onboard").json()
    assert (listed["vehicle"], listed["free_bytes"]) == ("quad1", 4_000_000_000)
    first, torn = listed["logs"]
    assert (first["name"], first["bytes"], first["start"], first["end"]) == (LOG, 7, 5.0, 65.0)
    assert (torn["closed"], torn["start"], torn["here"]) == (False, None, None)
    assert first["here"] is None
    copy = site.data / "onboard" / "quad1" / LOG
    copy.parent.mkdir(parents=True)
    copy.write_bytes(b"7 bytes")
    here = operator.get("/api/onboard").json()["logs"][0]["here"]
    assert here == f"onboard:quad1:{LOG.removesuffix('.mcap')}"
    assert {"id": here, "bytes": 7} in operator.get("/api/replay").json()
    assert operator.get(f"/api/replay/{here}").status_code == 200
    copy.write_bytes(b"another one")
    assert operator.get("/api/onboard").json()["logs"][0]["here"] is None


def test_what_is_asked_for_goes_to_the_station_with_who_asked(
    site: Any, operator: httpx.Client
) -> None:
    me = operator.get("/api/session").json()["label"]
    site.station.requests.clear()
    for path in (
        f"/api/onboard/{LOG}/download",
        f"/api/onboard/{LOG}/cancel",
        f"/api/runs/{RUN}/backfill",
        f"/api/runs/{RUN}/backfill/cancel",
    ):
        assert operator.post(path).json() == {"accepted": True}
    asked = [(r.action, r.name, r.requester) for _, r in site.station.requests]
    assert asked == [
        ("download", LOG, me),
        ("cancel", LOG, me),
        ("backfill", RUN, me),
        ("cancel", RUN, me),
    ]
    assert operator.post("/api/runs/unknown/backfill").status_code == 404


def test_a_refusal_is_its_one_line(site: Any, operator: httpx.Client) -> None:
    site.station.refusal = "the link to the vehicle is lost; its logs cannot be listed"
    answer = operator.get("/api/onboard")
    site.station.refusal = ""
    assert (answer.status_code, answer.json()["error"][:29]) == (
        409,
        "the link to the vehicle is lo",
    )


def test_the_summary_tells_what_is_under_way(site: Any, operator: httpx.Client) -> None:
    one = new(
        "quadlab_msgs/Transfer",
        kind="backfill",
        name=RUN,
        phase="fetching",
        bytes=20,
        total_bytes=100,
        rate=10.0,
    )
    site.station.put(
        "transfers", new("quadlab_msgs/Transfers", header=header(time.time_ns()), transfers=[one])
    )
    told = operator.get("/api/summary").json()["transfers"]
    assert told == [
        {
            "kind": "backfill",
            "name": RUN,
            "phase": "fetching",
            "bytes": 20,
            "total_bytes": 100,
            "rate": 10.0,
            "problem": "",
        }
    ]


def test_a_run_tells_how_it_compares_with_the_vehicle_s_log(
    site: Any, operator: httpx.Client
) -> None:
    assert operator.get("/api/runs").json()[0]["completeness"] is None
    catalogue = Catalogue(site.data)
    why = "the vehicle's log of it was overwritten"
    store_completeness(catalogue, RUN, Completeness("missing", 0.0, 0.8, 62.0, why))
    catalogue.close()
    found = operator.get("/api/runs").json()[0]["completeness"]
    assert (found["state"], found["missing"]) == ("missing", 0.8)
    assert found["line"] == f"0.8 s missing of 62.0 s: {why}"
