"""Flight controls do not move under the pointer, from arming to a lost contact."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from console.catalogue.catalogue import Catalogue
from quadrotor.parameters import Parameters, ParameterStore
from vehicle.safety.parameters import SafetyParameters
from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import header, new
from web.latest import TICKS

PLACES = """() => { scrollTo(0, 0); document.querySelector('#tab-fly').scrollTop = 0;
  return Object.fromEntries([...document.querySelectorAll(
  '.controls button, #behaviors button, #record, #sticks button')]
  .filter((one) => one.checkVisibility()).map((one) => {
    const { x, y, width, height } = one.getBoundingClientRect();
    return [`${one.closest('[id]').id} ${one.id || one.textContent}`,
            { x, y, width, height }]; })); }"""
"""Script for the boxes (px) of everything that commands the vehicle, by name."""
MOST = 0.5  # px
LONG = "take off refused: " + "the battery is at 13.2 V and arming needs 13.8 V; " * 4
STANDS = {"mode": "ready", "armed": False, "airborne": False, "behavior": "ground"}
FLIES: dict[str, Any] = {}
NEAR = {"control_mode": "near_hovering", "behavior": "follow_trajectory"}
ALONE = {
    "mode": "emergency_land",
    "control_mode": "emergency",
    "behavior": "emergency_landing",
    "flags": ["not_real_time", "battery_low", "no_pose", "link_degraded", "tilt_limited"],
}
PICTURES = os.environ.get("QUADLAB_PICTURES", "")
"""Folder for a picture of each step, to be inspected."""


class _Root(Parameters):
    safety: SafetyParameters = SafetyParameters()


class Cockpit:
    """Separate flying site, with the vehicle's status and whether anything arrives."""

    def __init__(self, site: Any) -> None:
        self.site, self.station = site, site.station
        self.reasons = 0
        self.silent: frozenset[str] = frozenset()  # topics that do not arrive
        self._ended = threading.Event()
        self.link = "good"
        self.station.store = ParameterStore(_Root().model_copy(deep=True))
        self._put = self.station.put
        self.station.put = self._spoken
        self._thread = threading.Thread(target=self._fly, daemon=True)
        self._thread.start()

    def _spoken(self, topic: str, message: Any) -> None:
        if topic == "link_status":
            message.state = self.link
        if topic not in self.silent:
            self._put(topic, message)

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _fly(self) -> None:
        while not self._ended.wait(0.1):
            self.station.fly()
            checks = [
                Check(f"check {i}", "fail" if i < self.reasons else "ok", "bad", "good", "mend it")
                for i in range(6)
            ]
            message = new(
                "quadlab_msgs/Preflight",
                header=header(1),
                ready=not self.reasons,
                blocks=True,
                checks=to_messages(checks),
            )
            self.station.put("preflight", message)


@pytest.fixture
def cockpit(serve: Any, tmp_path: Path) -> Iterator[Callable[[], Any]]:
    """Yield a context manager for a Cockpit, which is closed when the block ends."""
    catalogue = Catalogue(tmp_path)

    @contextmanager
    def begin() -> Iterator[Cockpit]:
        with serve(tmp_path, catalogue) as site:
            flown = Cockpit(site)
            yield flown
            flown.close()

    yield begin
    catalogue.close()


SIZES = [(1440, 900), (1280, 720), (1024, 700), (390, 844)]


def test_no_flight_control_moves_from_arming_to_a_lost_contact(
    cockpit: Any, open_page: Any, look_at: Any
) -> None:
    steps: dict[str, dict[str, Any]] = {}  # boxes by step and, within it, window and name
    pages: list[Any] = []

    def text(place: str, wanted: str) -> None:
        for page in pages:
            look_at(page).text(place, wanted)

    def wait(place: str, **state: str) -> None:
        for page in pages:
            page.wait_for_selector(place, **state)

    def click(place: str) -> None:
        for page in pages:
            page.click(place)

    def record(step: str) -> None:
        pages[-1].wait_for_timeout(150)  # a late layout would be missed otherwise, no false alarm
        steps[step] = {
            f"{width} {name}": box
            for page, (width, _) in zip(pages, SIZES, strict=True)
            for name, box in page.evaluate(PLACES).items()
        }
        if PICTURES:
            for page, (width, _) in zip(pages, SIZES, strict=True):
                page.screenshot(path=f"{PICTURES}/{width}-{len(steps)}-{step}.png")

    with cockpit() as flown:
        station = flown.station
        station.said, flown.reasons = STANDS, 3
        for width, height in SIZES:
            page = open_page(flown.site)
            page.keyboard.press("Escape")  # the help of a first visit
            page.set_viewport_size({"width": width, "height": height})
            pages.append(page)
        text("#doing", "^NOT READY$")
        text("#preflight summary", "Not ready: 3 reasons")
        record("not ready")
        flown.reasons = 0
        text("#preflight summary", "Ready to arm")
        record("ready")
        station.said = {**STANDS, "mode": "armed", "armed": True}
        text("#doing", "^ARMED$")
        record("armed")
        station.said = FLIES
        text("#behavior", "^hover$")
        record("flying")
        station.said = NEAR
        text("#behavior", "^follow trajectory$")
        record("near-hovering")
        station.refusal = LONG
        click("#behaviors button:text-is('Take off')")
        text("#answer", "13.2 V")
        record("refused")
        station.refusal = ""
        click("#record")
        text("#answer", "accepted")
        record("accepted")
        station.said = ALONE
        text("#behavior", "^lands alone$")
        record("emergency landing")
        station.said = FLIES
        text("#behavior", "^hover$")
        flown.silent, flown.link = frozenset({TICKS, "status"}), "lost"
        wait("#contact[data-cause=link]")
        text("#contact .next", "lands in|landing now")
        record("link lost")
        text("#contact .next", r"landing now, for [\d.]+ s")
        flown.silent, flown.link = frozenset(), "good"
        wait("#contact", state="hidden")
        flown.silent = frozenset({TICKS, "status"})
        wait("#contact[data-cause=flight]")
        text("#contact .next", "microcontroller")
        record("flight process gone")
        flown.silent = frozenset(TOPICS_OF_ALL)
        wait("#contact[data-cause=station]")
        record("station gone")
        flown.silent = frozenset()
        wait("#contact", state="hidden")
        record("heard again")
    wait("#contact[data-cause=page]")
    text("#contact .ago", r"([2-9]|\d\d)\.\d s")  # it counts up
    record("offline")
    for page in pages:
        page.close()

    first = steps["not ready"]
    for width, _ in SIZES:
        assert {f"{width} {name}" for name in ("arm arm", "cut cut", "land land")} <= first.keys()
    moved = [
        f"{step}: {name} by {side} {box[side] - first[name][side]:+.1f} px"
        for step, boxes in steps.items()
        for name, box in boxes.items()
        for side in box
        if abs(box[side] - first[name][side]) > MOST
    ]
    assert moved == []
    assert all(boxes.keys() == first.keys() for boxes in steps.values()), "none disappears"


TOPICS_OF_ALL = (
    TICKS,
    "status",
    "truth",
    "estimator",
    "battery",
    "link_status",
    "station_status",
    "preflight",
)
