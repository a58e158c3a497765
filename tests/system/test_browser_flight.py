"""A user signs in with a real browser, flies, tunes, lands and downloads the log."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from tests.support.chromium import FLAGS
from tests.support.rates import RATES

pytestmark = pytest.mark.timeout(300)
BOUND = 60_000
GAIN = "control.position.kp_xy"


@pytest.fixture
def page(chromium_path: str) -> Any:
    """Yield a page of Chromium."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium_path, args=FLAGS)
        context = browser.new_context(
            viewport={"width": 1000, "height": 640}, accept_downloads=True
        )
        context.set_default_timeout(BOUND)
        yield context.new_page()
        browser.close()


def test_a_user_flies_tunes_lands_and_takes_the_log_home(
    page: Any, lab: Any, until: Callable[..., Any], tmp_path: Path
) -> None:
    from playwright.sync_api import expect

    # Without a graphics card the 3D view takes a core, which a real-time flight needs: the page
    # flies without it here (web/browser/console/test_view.py draws it).
    page.route("**/viser/**", lambda route: route.fulfill(status=200, body=""))
    page.goto(lab.link())

    def shows(selector: str, pattern: str) -> None:
        expect(page.locator(selector)).to_have_text(re.compile(pattern), timeout=BOUND)

    # The vehicle is connected.
    shows("#doing", "^(NOT )?READY$")
    lab.browser.cookies.update({c["name"]: c["value"] for c in page.context.cookies()})
    shows("#preflight summary", "Ready to arm")

    # Hold Arm, take off, fly the 8.
    arm = page.locator("#arm")
    arm.dispatch_event("pointerdown", {"button": 0})
    shows("#doing", "^ARMED$")
    arm.dispatch_event("pointerup", {"button": 0})
    until("motors on", lambda: "motors" not in page.locator("#answer").inner_text(), 5)
    page.wait_for_selector("#primary:not([data-new])")
    page.locator("#take-off").click()
    shows("#behavior", "^hover$")
    row = page.locator(".behavior", has_text="Figure 8")
    row.locator("input").first.fill("1")
    row.get_by_role("button").click()
    shows("#behavior", "Figure 8")

    # Drag a gain; the cell shows the value that the vehicle confirmed, not the slider's.
    page.locator("[data-tab=gains]").click()
    page.locator("#search").fill(GAIN)
    slider = page.locator(f"input[type=range][aria-label='{GAIN}']")
    before = float(slider.input_value())
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    assert box is not None
    middle, share = box["y"] + box["height"] / 2, before / float(slider.get_attribute("max"))
    page.mouse.move(box["x"] + share * box["width"], middle)
    page.mouse.down()
    page.mouse.move(box["x"] + (share + 0.1) * box["width"], middle, steps=8)
    wanted = float(slider.input_value())  # when released, the thumb moves to the vehicle's value
    page.mouse.up()
    assert wanted > before
    confirmed = page.locator(f"input[aria-label='{GAIN}, value']")
    expect(confirmed).to_have_value(re.compile(rf"^{wanted:g}$"), timeout=BOUND)
    assert lab.get("/api/parameters")["revision"] >= 1

    # The 8 ends in hover by itself. A step on x is judged from the vehicle's own log.
    page.locator("[data-tab=tune]").click()
    shows("#behavior", "^hover$")
    step = {"axis": "x", "amplitude": 0.2, "duration": 1.0}
    begun = lambda: lab.browser.post("/api/tuning/run", json=step).status_code == 200  # noqa: E731
    until("rest, and a step test", begun, 20)
    shows(".tests .what", r"^x step 0\.20 m$")
    [test] = lab.get("/api/tuning")["runs"]
    assert test["gains"][GAIN] == pytest.approx(wanted)
    assert test["rate"] == pytest.approx(500.0, rel=0.02)
    assert [edge["swing"] for edge in test["edges"]] == pytest.approx([0.2, -0.2], abs=1e-5)
    shows(".figures-of-tests tbody tr >> nth=0", r"^delay to 50 %0\.\d\ds$")

    # Land and disarm.
    page.locator("[data-tab=fly]").click()
    page.locator("#land").click()
    shows("#doing", "^(NOT )?READY$")

    # Download the log.
    until("the end of the recording", lambda: not lab.summary()["station"]["recording"], 20)
    page.locator(".pages a", has_text="Runs").click()
    expect(page.locator("#list tr[data-index] .state").first).to_have_text(
        "complete", timeout=BOUND
    )
    with page.expect_download(timeout=BOUND) as download:
        page.locator("#detail a", has_text="Download").click()
    log = tmp_path / "home.mcap"
    download.value.save_as(log)
    check_log(log, wanted)


def check_log(log: Path, gain: float) -> None:
    """Check the log: closed, readable by mcap and rosbags, all rates, parameters and the change."""
    with log.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None, "the file has no index: it was not closed"
        assert summary.statistics is not None
        seconds = (
            summary.statistics.message_end_time - summary.statistics.message_start_time
        ) * 1e-9
        counts: Counter[str] = Counter()
        for channel, count in summary.statistics.channel_message_counts.items():
            counts[summary.channels[channel].topic.removeprefix("/quad1/")] += count
        attachments = {a.name: a.data for a in reader.iter_attachments()}
    for topic, rate in RATES.items():
        assert counts[topic] / seconds == pytest.approx(rate, rel=0.15), topic
    values = json.loads(attachments["parameters.json"])
    assert GAIN in json.dumps(values)

    changes: list[Any] = []
    events: list[str] = []
    heights: list[float] = []
    with AnyReader([log]) as bag:
        told = ("/parameter_changes", "/events", "/truth")
        wanted = [c for c in bag.connections if c.topic.endswith(told)]
        for connection, _, raw in bag.messages(wanted):
            message: Any = bag.deserialize(raw, connection.msgtype)
            if connection.topic.endswith("/parameter_changes"):
                changes.append(message)
            elif connection.topic.endswith("/events"):
                events.append(message.msg)
            elif connection.topic.endswith("/truth"):
                heights.append(message.pose.pose.position.z)
    assert [c.name for c in changes] == [GAIN] * len(changes)
    last = changes[-1]
    assert last.new_value.double_value == pytest.approx(gain)
    assert changes[0].old_value.double_value != last.new_value.double_value
    assert last.requester.startswith("admin")
    assert last.header.stamp.sec > 0
    assert any("follow trajectory by admin" in text for text in events), events
    assert np.max(heights) == pytest.approx(1.2, abs=0.1)
