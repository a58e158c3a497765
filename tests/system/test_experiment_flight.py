"""Experiments on the whole laboratory: flown, judged, reported; calibration from a terminal."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import quadlab
from flight_log import read_attachments, read_log
from quadlab.__main__ import main
from vehicle_link.messages import decode

pytestmark = pytest.mark.timeout(240)


def test_bearings_are_flown_from_the_page_judged_and_reported(
    lab: Any, until: Callable[..., Any], tmp_path: Path
) -> None:
    lab.ready()
    calibrate(lab, until)

    def status() -> dict[str, Any]:
        return lab.summary().get("experiment") or {}

    wrong = {"name": "bearings", "options": {"duration": 1.0}}
    refused = lab.browser.post("/api/experiments/start", json=wrong)
    assert (refused.status_code, "allowed 5 to 3600 s" in refused.text) == (409, True)
    body = {"name": "bearings", "options": {"duration": 6.0}}
    started = lab.browser.post("/api/experiments/start", json=body)
    assert started.status_code == 200, started.text
    until("the hand-over", lambda: "on_bearings" in lab.status().get("flags", []), 90)
    ended = ("passed", "failed", "stopped", "refused")
    until("the verdict", lambda: status().get("phase") in ended, 120)
    done = status()
    # The quality of the flight depends on the computer's load; the judgement does not.
    assert done["verdict"] in ("passed", "failed"), (done, lab.output)
    figures = {metric["name"]: metric["value"] for metric in done["metrics"]}
    assert 0.001 < figures["position_rms_m"] < 0.5
    assert figures["judged_s"] > 5.0
    lab.reach(mode="ready", armed=False)

    report = lab.get(f"/api/runs/{done['run_id']}/report")
    assert report["verdict"] == done["verdict"]
    assert report["options"]["duration"] == 6.0
    [picture] = [name for name in report["files"] if name.endswith(".png")]
    answer = lab.browser.get(f"/api/runs/{done['run_id']}/report/{picture}")
    assert answer.content.startswith(b"\x89PNG")
    [run] = [one for one in lab.runs() if one["id"] == done["run_id"]]
    assert (run["id"], run["report"], run["complete"]) == (done["run_id"], True, True)
    told: list[Any] = [
        decode(message.payload, message.type_name)
        for message in read_log(
            lab.data / "runs" / run["id"], {"/quad1/experiment_status", "/quad1/parameter_changes"}
        )
    ]
    assert {m.phase for m in told if hasattr(m, "phase")} >= {"flying"}
    assert {m.requester for m in told if hasattr(m, "old_value")} == {run["operator"]}
    with quadlab.connect(lab.link()) as script:
        assert script.parameters["estimation.estimator"] == "complementary", "as it was found"
        assert script.open(run["id"], tmp_path)["state"]["time"][-1] > figures["judged_s"]
        assert abs(next(script.stream("state.position.z"))["state.position.z"]) < 0.1


def calibrate(lab: Any, until: Callable[..., Any]) -> None:
    """Calibrate the gyroscope from a terminal: on the ground, recorded, stored by the vehicle."""

    def is_told() -> bool:
        history = lab.get("/api/calibrations")["history"] or []
        return any(one["name"] == "gyroscope" for one in history)

    until("the gyroscope of the start", is_told, 20)
    words = ["gyroscope", "--accept", "--set", "samples=200", "--loopback-port"]
    assert main(["calibrate", *words, str(lab.link_port)]) == 0
    run = lab.runs()[0]
    assert (run["report"], run["complete"]) == (True, True)

    def newest() -> tuple[str, str]:
        history = lab.get("/api/calibrations")["history"] or [{"name": "", "run_id": ""}]
        return history[0]["name"], history[0]["run_id"]

    until("the vehicle's history", lambda: newest() == ("gyroscope", run["id"]), 10)
    kept = read_attachments(lab.data / "runs" / run["id"])["calibrations.json"]
    assert json.loads(kept)["in_force"]["gyroscope"]["requester"] == "start"
