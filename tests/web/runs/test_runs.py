"""Logs can be listed and fetched, whole or in ranges, and nothing else on the disk can."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from console.catalogue.catalogue import Catalogue
from flight_log.run_folder import MERGED, STATION

RUN = "20260131T093042Z_quad1"
LOG = bytes(range(256)) * 40
DOWNLOAD = f"/api/runs/{RUN}/download"


def test_the_list_is_the_catalogues(operator: httpx.Client) -> None:
    runs = operator.get("/api/runs").json()
    assert [run["id"] for run in runs] == [RUN, "elsewhere"]
    assert runs[0]["duration"] == 63.2
    assert operator.get("/api/runs", params={"search": "else"}).json()[0]["id"] == "elsewhere"


def test_a_log_comes_whole(operator: httpx.Client) -> None:
    answer = operator.get(DOWNLOAD)
    assert answer.status_code == 200
    assert answer.content == LOG
    assert f"{RUN}.mcap" in answer.headers["content-disposition"]


def test_a_run_that_is_a_folder_comes_as_one_file(site: Any, operator: httpx.Client) -> None:
    """The file is the station's log, or both logs merged once that was made."""
    catalogue, run_id = Catalogue(Path(site.data)), "20260130T093042Z_quad1"
    folder = catalogue.folder / run_id
    folder.mkdir()
    try:
        catalogue.add(replace(catalogue.get(RUN), id=run_id, file=run_id))
        for name, content in ((STATION, b"the station's"), (MERGED, b"both in one")):
            (folder / name).write_bytes(content)
            answer = operator.get(f"/api/runs/{run_id}/download")
            assert (answer.status_code, answer.content) == (200, content)
            assert f"{run_id}.mcap" in answer.headers["content-disposition"]
            part = operator.get(f"/api/runs/{run_id}/download", headers={"Range": "bytes=4-"})
            assert (part.status_code, part.content) == (206, content[4:])
    finally:
        shutil.rmtree(folder)
        catalogue.remove(run_id)
        catalogue.close()


def test_head_tells_the_size(operator: httpx.Client) -> None:
    answer = operator.head(DOWNLOAD)
    assert answer.status_code == 200
    assert answer.headers["content-length"] == str(len(LOG))
    assert answer.headers["accept-ranges"] == "bytes"
    assert answer.content == b""


@pytest.mark.parametrize(
    ("asked", "part"),
    [("bytes=0-9", LOG[:10]), ("bytes=10200-", LOG[10200:]), ("bytes=-7", LOG[-7:])],
)
def test_a_range_resumes_a_download(operator: httpx.Client, asked: str, part: bytes) -> None:
    answer = operator.get(DOWNLOAD, headers={"Range": asked})
    assert answer.status_code == 206
    assert answer.content == part


def test_a_range_beyond_the_end_is_refused(operator: httpx.Client) -> None:
    assert operator.get(DOWNLOAD, headers={"Range": "bytes=99999-"}).status_code == 416


@pytest.mark.parametrize(
    "name",
    [
        "unknown",
        "..",
        "%2e%2e",
        "..%2f..%2fweb%2fdoor.json",
        "%2fetc%2fpasswd",
        "..%5cweb%5cdoor.json",
        f"{RUN}.mcap",
        "elsewhere",
    ],
)
def test_no_name_leads_out_of_the_runs_folder(site: Any, operator: httpx.Client, name: str) -> None:
    """`elsewhere` is in the catalogue, with a path that leads out of the folder."""
    answer = operator.get(f"/api/runs/{name}/download")
    assert answer.status_code == 404
    assert (Path(site.data) / "web" / "door.json").read_bytes() not in answer.content
    assert "\n" not in answer.json()["error"]


def test_notes_are_kept_with_their_author_and_nobodys_are_lost(
    operator: httpx.Client, admin: httpx.Client
) -> None:
    path = f"/api/runs/{RUN}/notes"
    first = operator.put(path, json={"notes": "kp_xy 5, windy"})
    assert first.status_code == 200
    run = operator.get("/api/runs").json()[0]
    me = operator.get("/api/session").json()["label"]
    assert (run["notes"], run["notes_by"]["author"]) == ("kp_xy 5, windy", me)
    seen = run["notes_by"]["version"] - 1
    other = admin.put(path, json={"notes": "calm", "seen": seen}).json()
    assert (other["replaced"]["notes"], other["replaced"]["author"]) == ("kp_xy 5, windy", me)
    texts = [one["notes"] for one in operator.get(path).json()]
    assert texts[:2] == ["calm", "kp_xy 5, windy"]
    assert operator.put("/api/runs/unknown/notes", json={"notes": ""}).status_code == 404
    operator.put(path, json={"notes": ""})


def test_tags_come_and_go_for_several_runs_at_once(operator: httpx.Client) -> None:
    runs = [RUN, "elsewhere"]
    answer = operator.post("/api/tags", json={"runs": runs, "add": ["wind", "to show"]})
    assert answer.json() == {run: ["to show", "wind"] for run in runs}
    assert {"tag": "wind", "runs": 2} in operator.get("/api/tags").json()
    page = operator.get("/api/runs/search", params={"tag": "wind", "limit": 1}).json()
    assert (page["total"], [run["id"] for run in page["runs"]]) == (2, [RUN])
    assert page["runs"][0]["tags"] == ["to show", "wind"]
    operator.post("/api/tags", json={"runs": runs, "remove": ["wind", "to show"]})
    assert operator.get("/api/tags").json() == []
    assert operator.post("/api/tags", json={"runs": ["nope"], "add": ["x"]}).status_code == 404
    refused = operator.post("/api/tags", json={"runs": runs, "add": ["a,b"]})
    assert refused.status_code == 422
    assert "no comma" in refused.json()["error"]


def test_a_page_of_the_list_says_how_many_there_are(operator: httpx.Client) -> None:
    page = operator.get("/api/runs/search", params={"limit": 1, "offset": 1}).json()
    assert (page["total"], [run["id"] for run in page["runs"]]) == (2, ["elsewhere"])
    since = 1_769_851_842_000_000_000
    assert operator.get("/api/runs/search", params={"since_ns": since}).json()["total"] == 1
    assert operator.get("/api/runs/search", params={"until_ns": since}).json()["total"] == 1
    assert operator.get("/api/runs/search", params={"limit": 5000}).status_code == 422


def test_several_runs_are_deleted_and_brought_back_with_reasons_for_the_others(
    operator: httpx.Client, viewer: httpx.Client
) -> None:
    answer = operator.post("/api/trash", json={"runs": [RUN, "nope", "elsewhere"]}).json()
    assert answer["done"] == [RUN]
    assert "no run 'nope'" in answer["refused"]["nope"]
    assert "is not inside" in answer["refused"]["elsewhere"]
    assert operator.get(DOWNLOAD).status_code == 404
    [deleted] = viewer.get("/api/trash").json()
    assert deleted["id"] == RUN
    assert deleted["requester"] == operator.get("/api/session").json()["label"]
    assert operator.post("/api/trash/empty").status_code == 403
    assert operator.post("/api/trash/restore", json={"runs": [RUN]}).json()["done"] == [RUN]
    assert operator.get(DOWNLOAD).content == LOG


def test_the_gauge_knows_sizes_and_the_configured_limits(operator: httpx.Client) -> None:
    found = operator.get("/api/storage").json()
    assert found["run_bytes"] == len(LOG) + 1
    assert (found["keep_free"], found["warn_free"], found["trash_days"]) == (5e8, 5e9, 7.0)
    assert found["free"] > 0


def test_a_mark_goes_to_the_station_with_the_time_of_the_key_press(
    operator: httpx.Client, station: Any
) -> None:
    now_ns = time.time_ns()
    answer = operator.post("/api/marks", json={"id": "mark-0001", "ago": 2.0})
    assert answer.status_code == 200
    [(service, request)] = station.requests
    assert (service, request.id, request.text) == ("mark", "mark-0001", "")
    assert request.requester == operator.get("/api/session").json()["label"]
    assert 0 <= request.pressed_ns - now_ns + 2_000_000_000 < 5_000_000_000
    operator.post("/api/marks", json={"id": "mark-0001", "text": "gust"})
    assert (station.requests[1][1].pressed_ns, station.requests[1][1].text) == (0, "gust")


@pytest.mark.parametrize(
    "body",
    [
        {"id": "short", "ago": 1.0},
        {"id": "mark-0001", "ago": -1.0},
        {"id": "mark-0001", "ago": 11.0},
        {"id": "mark-0001", "text": "x" * 501},
        {"id": "mark/0001"},
        {"id": "mark-0001", "run": "other"},
    ],
)
def test_a_mark_that_makes_no_sense_never_reaches_the_station(
    operator: httpx.Client, station: Any, body: dict[str, Any]
) -> None:
    assert operator.post("/api/marks", json=body).status_code == 422
    assert station.requests == []


def test_a_refused_mark_says_why(operator: httpx.Client, station: Any) -> None:
    station.refusal = "nothing is being recorded, so there is no log to mark"
    answer = operator.post("/api/marks", json={"id": "mark-0001", "ago": 0.0})
    assert answer.status_code == 409
    assert "nothing is being recorded" in answer.json()["error"]
