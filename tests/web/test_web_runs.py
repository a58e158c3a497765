"""Logs can be listed and fetched, whole or in ranges, and nothing else of the disk can."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import httpx
import pytest

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
        "unknown", "..", "%2e%2e", "..%2f..%2fweb%2fdoor.json", "%2fetc%2fpasswd",
        "..%5cweb%5cdoor.json", f"{RUN}.mcap", "elsewhere",
    ],
)  # fmt: skip
def test_no_name_leads_out_of_the_runs_folder(site: Any, operator: httpx.Client, name: str) -> None:
    """`elsewhere` is in the catalogue, with a path that leads out of the folder."""
    answer = operator.get(f"/api/runs/{name}/download")
    assert answer.status_code == 404
    assert (Path(site.data) / "web" / "door.json").read_bytes() not in answer.content
    assert "\n" not in answer.json()["error"]


def test_notes_are_kept(operator: httpx.Client) -> None:
    answer = operator.put(f"/api/runs/{RUN}/notes", json={"notes": "kp_xy 5, windy"})
    assert answer.status_code == 200
    assert operator.get("/api/runs").json()[0]["notes"] == "kp_xy 5, windy"
    assert operator.put("/api/runs/unknown/notes", json={"notes": ""}).status_code == 404
