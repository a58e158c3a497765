"""The routes of the page: campaigns of the data folder, their figures, rows and commands."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI

from extensions.campaigns.routes import add_campaigns
from extensions.campaigns.shard import Shard
from extensions.campaigns.tests.conftest import COMPILED
from quadrotor.errors import UsageError
from vehicle_link import jobs

TWO = (
    COMPILED
    + '[factors]\n"control.position.kp_xy" = [3.0, 5.0]\n"simulator.drag" = [0.0, 0.1, 0.2]\n'
)


class Client:
    """A client of an application in this process."""

    def __init__(self, app: FastAPI) -> None:
        self._transport = httpx.ASGITransport(app)

    def get(self, path: str, params: Mapping[str, str] | None = None) -> httpx.Response:
        async def answered() -> httpx.Response:
            async with httpx.AsyncClient(transport=self._transport, base_url="http://page") as page:
                return await page.get(path, params=params)

        return asyncio.run(answered())


@pytest.fixture
def client(bench: Any) -> Client:
    """Return a client of the routes of a data folder with campaigns."""
    bench.flown(TWO, "campaigns/two")
    app, place = FastAPI(), bench.folder / "runs"
    shared = SimpleNamespace(catalogue=SimpleNamespace(folder=place), closing=ExitStack())
    add_campaigns(app, shared)  # type: ignore[arg-type]
    return Client(app)


def test_campaigns_are_listed_with_their_progress(client: Client, bench: Any) -> None:
    part = bench.flown(COMPILED, "campaigns/part", Shard(1, 2))
    (bench.folder / "campaigns" / "other").mkdir()
    listed = {one["name"]: one for one in client.get("/api/campaigns").json()["campaigns"]}
    assert {name: (one["rows"], one["flights"]) for name, one in listed.items()} == {
        "part": (3, 5),
        "two": (30, 30),
    }
    assert not listed["part"]["running"]
    with part.owned():
        found = client.get("/api/campaigns").json()["campaigns"]
    assert {one["name"]: one["running"] for one in found} == {"part": True, "two": False}


def test_a_campaign_has_its_distribution_and_map(client: Client, bench: Any) -> None:
    found = client.get("/api/campaigns/two").json()
    assert (found["metric"], found["x"], found["y"]) == (
        "position_rms_m",
        "control.position.kp_xy",
        "simulator.drag",
    )
    assert found["heat"]["x"] == ["3", "5"]
    assert found["heat"]["y"] == ["0", "0.1", "0.2"]
    table = bench.flown(TWO, "campaigns/two").table()
    errors = table["position_rms_m"].to_numpy()
    medians = np.median(errors.reshape(2, 3, 5), axis=2).T
    np.testing.assert_array_equal(found["heat"]["medians"], medians)
    curve = found["ecdf"]
    assert curve["values"] == sorted(curve["values"])
    assert curve["values"][-1] == errors.max()
    assert curve["shares"][-1] == 1.0
    assert curve["interval"][0] <= curve["median"] <= curve["interval"][1]
    values = [one["value"] for one in found["list"]]
    assert values == sorted(errors, reverse=True)


def test_a_campaign_has_the_effects_of_its_factors_and_single_flights(
    client: Client, bench: Any
) -> None:
    found = client.get("/api/campaigns/two", params={"metric": "tilt_max_deg"}).json()
    table = bench.flown(TWO, "campaigns/two").table()
    tilts = table["tilt_max_deg"].to_numpy().reshape(2, 3, 5)
    effects = {one["factor"]: [a["median"] for a in one["levels"]] for one in found["effects"]}
    np.testing.assert_array_equal(
        effects["control.position.kp_xy"], np.median(tilts.reshape(2, -1), axis=1)
    )
    np.testing.assert_array_equal(effects["simulator.drag"], np.median(tilts, axis=(0, 2)))
    points = found["points"]
    assert points["names"] == ["control.position.kp_xy", "simulator.drag", "tilt_max_deg"]
    assert points["indices"] == list(range(30))
    for k, name in enumerate(points["names"]):
        assert [one[k] for one in points["values"]] == table[name].to_pylist()
    assert found["sensitivity"] == []  # of a grid
    assert found["search"] is None
    row = client.get("/api/campaigns/two/flights/7", params={"metric": "tilt_max_deg"}).json()
    assert row == {
        "index": 7,
        "verdict": "passed",
        "reason": "",
        "value": tilts.reshape(-1)[7],
        "command": "",  # compiled
    }
    with pytest.raises(UsageError, match="flight 30 of two has no row"):
        client.get("/api/campaigns/two/flights/30")


def test_the_report_is_made_again_only_for_more_rows(
    client: Client, bench: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = bench.flown(COMPILED, "campaigns/part", Shard(1, 2))
    made = []

    def here(function: Any, *arguments: Any, seconds: float) -> None:
        made.append(arguments)
        function(*arguments)

    monkeypatch.setattr(jobs, "run", here)
    answer = client.get("/api/campaigns/part/report")
    assert "Campaign part" in answer.text
    assert "3 of 5" in answer.text
    assert answer.headers["content-security-policy"].startswith("sandbox; default-src 'none'")
    assert client.get("/api/campaigns/part/report").text == answer.text
    assert len(made) == 1
    bench.flown(COMPILED, "campaigns/part", Shard(2, 2))
    assert "5 of 5" in client.get("/api/campaigns/part/report").text
    assert part.is_whole()


def test_a_campaign_whose_flights_have_no_figures_is_shown(client: Client, bench: Any) -> None:
    crashing = COMPILED.replace("2.0\n", "2.0\n", 1) + '"simulator.failed_motor" = 1\n'
    bench.flown(crashing.replace('"experiment.hover" = 0.5', ""), "campaigns/fallen")
    found = client.get("/api/campaigns/fallen", params={"metric": "gone"}).json()
    assert found["rows"] == 5
    assert found["metrics"] == []
    assert [one["verdict"] for one in found["list"]] == ["failed"] * 5


def test_no_folder_outside_is_read(client: Client, bench: Any, tmp_path: Path) -> None:
    bench.flown(COMPILED, "outside")
    for name in ("..%2Foutside", "outside", ".."):
        try:
            answer = client.get(f"/api/campaigns/{name}")
        except UsageError as error:
            assert "there is no campaign" in str(error)  # noqa: PT017
        else:
            assert answer.status_code == 404 or "outside" not in answer.text
