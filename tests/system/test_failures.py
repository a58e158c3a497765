"""Processes that die in flight: the others continue, and nothing is lost."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flight_log import is_closed, read_log
from vehicle_link.messages import decode
from vehicle_link.topics.ticks import decode_odometry

pytestmark = pytest.mark.timeout(240)
Lab = Any


def stamps(path: Path, topic: str) -> np.ndarray:
    return np.array([m.publish_ns for m in read_log(path, {f"/quad1/{topic}"})]) * 1e-9


def test_a_killed_web_touches_neither_flight_nor_log_and_a_killed_flight_process_lands(
    lab: Lab, until: Callable[..., Any]
) -> None:
    lab.hover()
    flown = lab.summary()["station"]["recording_duration"]
    dead = lab.kill("web")
    lab.restarted("web", dead)
    lab.reach(mode="armed", behavior="hover")  # the same cookie is valid for the new process
    until(
        "a longer recording",
        lambda: (lab.summary().get("station") or {}).get("recording_duration", 0) > flown,
        10,
    )
    lab.start("brake")  # the new page commands the vehicle
    killed = lab.now()
    dead = lab.kill("flight")
    lab.restarted("flight", dead)
    lab.reach(mode="ready")
    ready = lab.now()
    run = next(r for r in lab.runs())
    path = lab.data / "runs" / run["id"]
    times = stamps(path, "state")
    assert np.diff(times[times < killed]).max() < 0.2, "the log has a hole"

    def truth_after_touch_down() -> list[tuple[int, Any]]:
        found = [decode_odometry(m.payload) for m in read_log(path, {"/quad1/truth"})]
        is_down = [t * 1e-9 > killed and one["position_w"][0, 2] < 0.005 for t, one in found]
        return found if any(is_down) else []

    truth = until("the touch-down in the recording", truth_after_touch_down, 10)
    heights = np.array([state["position_w"][0, 2] for _, state in truth])
    assert heights.max() == pytest.approx(1.0, abs=0.1)
    falling = np.array([stamp * 1e-9 > killed for stamp, _ in truth])
    sinking = np.array([-state["velocity_w"][0, 2] for _, state in truth])
    down = int(np.flatnonzero(falling & (heights < 0.005))[0])
    assert truth[down][0] * 1e-9 < ready, "ready before the microcontroller had landed"
    assert 0.0 < sinking[down - 1] < 0.8
    tilted = max(np.hypot(*state["quaternion_wb"][0, 1:3]) for _, state in truth[down:])
    assert tilted < np.sin(np.radians(5.0) / 2), "not upright"


def test_a_killed_station_makes_the_vehicle_brake_and_land_and_its_file_is_recovered(
    lab: Lab, until: Callable[..., Any]
) -> None:
    lab.hover()
    torn, onboard = lab.newest("runs"), lab.newest("onboard")
    with lab.nothing_restarted():
        killed = lab.now()
        lab.kill("station")
        until("the vehicle to land and close its log", lambda: is_closed(onboard), 40)

    events = [
        (m.publish_ns * 1e-9 - killed, decode(m.payload, "rcl_interfaces/Log").msg)
        for m in read_log(onboard, {"/quad1/events"})
    ]
    braked = next(t for t, text in events if text.startswith("braking"))
    landing = next(t for t, text in events if text.startswith("emergency land"))
    assert 0.0 < braked < 0.5, events
    assert landing - braked == pytest.approx(2.0, abs=0.1), events
    assert any(text == "touched down" for _, text in events), events

    landed = "emergency land: still no heartbeat from the station after"
    assert any(line.startswith(f"vehicle quad1: {landed}") for line in lab.lines)

    lab.reach(mode="ready")  # the station runs again, and the page is connected to it

    def told() -> bool:
        return any(landed in event["text"] for event in lab.get("/api/events"))

    until("the reason of the landing on the page", told, 20)

    def printed() -> bool:
        return any(line.startswith("station: quad1:") and landed in line for line in lab.lines)

    until("the reason of the landing in the terminal", printed, 20)
    until("the torn file's recovery", lambda: is_closed(torn), 30)

    def listed() -> bool:
        return any(r["id"] == torn.stem and r["recovered"] for r in lab.runs())

    until("its mark in the list of runs", listed, 10)
    assert len(stamps(torn, "state")) > 500


@pytest.mark.parametrize("process", ["comms", "station"])
def test_a_process_out_of_memory_is_replaced_and_land_is_heard(
    lab: Lab, until: Callable[..., Any], process: str
) -> None:
    lab.hover()
    starved = lab.pid(process)
    _, most = resource.prlimit(starved, resource.RLIMIT_AS)
    resource.prlimit(starved, resource.RLIMIT_AS, (1 << 20, most))
    until("the end of the deaf process", lambda: lab.pid(process) not in (None, starved), 30)
    until("Land", lambda: lab.command("start_behavior", name="land").status_code == 200, 30)
    lab.reach(mode="ready")
    again = {"comms": "and was started again", "station": "started again"}[process]

    def told() -> bool:
        events = [event["text"] for event in lab.get("/api/events")]
        return any(again in line for line in (events if process == "comms" else lab.lines))

    until("the reason", told, 20)
