"""A command is pending until a late answer or the vehicle's status settles it."""

from __future__ import annotations

from typing import Any

from vehicle_link.checks import Check, to_messages
from vehicle_link.messages import new

LATER = """(milliseconds) => { const now = performance.now.bind(performance);
  performance.now = () => now() + milliseconds; }"""
"""Script that advances the page's clock by so much."""


def is_gone(page: Any) -> None:
    page.wait_for_selector("#answer", state="hidden")


def test_a_refusal_to_arm_goes_when_the_vehicle_is_ready_again(
    page: Any, look: Any, station: Any
) -> None:
    def prepare(ready: bool) -> None:
        failing = [] if ready else [Check("link", "fail", "degraded", "good")]
        message = new("quadlab_msgs/Preflight", ready=ready, checks=to_messages(failing))
        station.put("preflight", message)

    station.said = {"mode": "ready", "armed": False, "airborne": False}
    page.wait_for_selector("#arm", state="visible")
    page.wait_for_selector("#primary:not([data-new])")
    station.refusal = "not armed: link: degraded, wanted good"
    prepare(True)  # the list is older than the refusal
    page.press("#arm", "Enter", delay=900)
    look.text("#answer", "^arm: not armed: link")
    prepare(False)
    look.text("#preflight", "Not ready")
    page.evaluate(LATER, 5000)
    page.wait_for_timeout(300)  # the notice is drawn again
    assert page.is_visible("#answer")
    prepare(True)
    is_gone(page)
