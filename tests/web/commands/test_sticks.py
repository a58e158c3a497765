"""Sticks act only while their button is held, never by themselves, and for one switch at a time."""

from __future__ import annotations

import json
import struct
from typing import Any

import httpx
import pytest

from web.commands.sticks import (
    CAUSES,
    REMEMBERED,
    SILENCE,
    Axes,
    DeadManSwitch,
    Frame,
    StickOutput,
    read_frame,
)

STILL = (0.0, 0.0, 0.0, 0.0)


def frame(
    forward: float = 0.0,
    left: float = 0.0,
    up: float = 0.0,
    yaw: float = 0.0,
    held: bool = False,
    number: int = 1,
    cause: int = 0,
) -> bytes:
    return struct.pack("<5f2I", forward, left, up, yaw, float(held), number, cause)


def given(axes: Axes = STILL, held: bool = False) -> Frame:
    return Frame(axes, held, 1, CAUSES[0])


HELD = given(held=True)


def test_a_button_held_from_the_start_does_not_count() -> None:
    switch = DeadManSwitch()
    assert not switch.take(HELD, 0.00)
    assert not switch.take(HELD, 0.02)
    assert "release the button" in switch.why
    assert not switch.take(given(), 0.04)
    assert switch.take(HELD, 0.06)


def test_after_a_silence_the_button_must_be_released_again() -> None:
    switch = DeadManSwitch()
    switch.take(given(), 0.0)
    assert switch.take(HELD, 0.02)
    assert not switch.take(HELD, 0.02 + SILENCE + 0.01)
    assert "silent for 0.26 s" in switch.why
    assert not switch.take(HELD, 0.04 + SILENCE)
    switch.take(given(), 0.06 + SILENCE)
    assert switch.take(HELD, 0.08 + SILENCE)


@pytest.mark.parametrize("axis", range(4))
@pytest.mark.parametrize("value", [0.06, -0.5, 1.0])
def test_the_button_counts_only_from_centred_sticks(axis: int, value: float) -> None:
    a, b, c, d = (value if i == axis else 0.0 for i in range(4))
    pushed = (a, b, c, d)
    switch = DeadManSwitch()
    switch.take(given(), 0.0)
    assert not switch.take(given(pushed, held=True), 0.02)
    assert "centre all sticks" in switch.why
    assert not switch.take(HELD, 0.04), "centred while held: still not"
    switch.take(given(), 0.06)
    assert switch.take(HELD, 0.08)
    assert switch.take(given(pushed, held=True), 0.10), "once on, the sticks may go anywhere"


def test_what_was_refused_from_outside_needs_a_release_too() -> None:
    switch = DeadManSwitch()
    switch.take(given(), 0.0)
    assert switch.take(HELD, 0.02)
    switch.refuse("someone else has control")
    assert not switch.take(HELD, 0.04)
    assert switch.why == "someone else has control"
    switch.take(given(), 0.06)
    assert switch.take(HELD, 0.08)


def test_a_frame_is_read_and_its_axes_clamped() -> None:
    read = read_frame(frame(5.0, -5.0, 0.5, 1.0, held=True, number=7, cause=3))
    assert read == Frame((1.0, -1.0, 0.5, 1.0), True, 7, "the pad was unplugged")


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"x" * 27,
        frame(float("nan")),
        struct.pack("<5f2I", 0, 0, 0, 0, float("inf"), 1, 0),
        frame(cause=len(CAUSES)),
    ],
)
def test_what_is_no_frame_is_refused(raw: bytes) -> None:
    with pytest.raises(ValueError, match="stick frame"):
        read_frame(raw)


class Desk:
    """Output with a controlled clock, its published sticks and its answers."""

    def __init__(self) -> None:
        self.now = 0.0
        self.published: list[tuple[Axes, bool, str]] = []
        self.answers: list[tuple[bool, str]] = []
        self.output = StickOutput(self._publish, lambda: self.now)

    def _publish(self, axes: Axes, enabled: bool, requester: str) -> int:
        self.published.append((axes, enabled, requester))
        return len(self.published)

    def send(self, switch: object, axes: Axes, requester: str = "ada") -> bool:
        return self.output.send(switch, axes, requester, lambda *told: self.answers.append(told))


def test_one_hand_keeps_the_sticks_until_it_lets_go() -> None:
    desk, one, two = Desk(), object(), object()
    assert desk.send(one, (1, 0, 0, 0))
    assert not desk.send(two, (0, 1, 0, 0), "grace")
    assert desk.published == [((1, 0, 0, 0), True, "ada")]
    desk.output.release(one)
    assert desk.published[-1] == (STILL, False, "ada")
    assert desk.send(two, (0, 1, 0, 0), "grace")
    assert desk.published[-1] == ((0, 1, 0, 0), True, "grace")


def test_a_silent_hand_loses_the_sticks() -> None:
    desk, one, two = Desk(), object(), object()
    desk.send(one, (1, 0, 0, 0))
    desk.now += SILENCE + 0.01
    assert desk.send(two, (0, 1, 0, 0))
    desk.output.release(one)  # its page closed later: the other's sticks stay
    assert desk.published[-1] == ((0, 1, 0, 0), True, "ada")


def test_a_hand_that_never_enabled_publishes_nothing() -> None:
    desk = Desk()
    desk.output.release(object())
    assert desk.published == []


def test_a_release_reaches_a_station_that_dropped_the_sticks_of_a_web_process_before() -> None:
    desk, one, two = Desk(), object(), object()
    desk.output.release(one, "ada")
    assert desk.published == [(STILL, False, "ada")], "the next press counts"
    desk.send(one, STILL)
    desk.output.release(two, "grace")
    assert desk.published[-1] == (STILL, True, "ada"), "another's sticks stay"


def test_the_stations_answer_finds_the_frame_it_is_for() -> None:
    desk, one = Desk(), object()
    desk.send(one, STILL)
    desk.output.answer(1, True, "")
    desk.output.answer(99, True, "nobody asked that")
    desk.output.answer(1, False, "silent for 0.25 s")
    assert desk.answers == [(True, ""), (False, "silent for 0.25 s")]


def test_frames_never_answered_are_forgotten() -> None:
    desk, one = Desk(), object()
    for _ in range(3 * REMEMBERED):
        desk.send(one, STILL)
    desk.output.answer(1, True, "")
    assert desk.answers == []
    assert len(desk.output._asked) == REMEMBERED


def test_a_page_is_answered_frame_by_frame_by_who_had_it(
    site: Any, operator: httpx.Client, station: Any
) -> None:
    with site.websocket("/ws/stick", site.cookie(operator)) as page:
        page.send(frame(number=1))
        assert json.loads(page.recv(20)) == {"n": 1, "by": "web", "on": False, "why": ""}
        page.send(frame(held=True, number=2))
        assert json.loads(page.recv(20)) == {"n": 2, "by": "station", "on": True, "why": ""}
        page.send(frame(number=3))
        assert json.loads(page.recv(20))["n"] == 3
        page.send(frame(0.5, held=True, number=4))
        answer = json.loads(page.recv(20))
        assert (answer["by"], answer["on"]) == ("web", False)
        assert "centre all sticks" in answer["why"]


def test_who_loses_control_loses_the_sticks_and_is_told(
    site: Any, operator: httpx.Client, station: Any, until: Any
) -> None:
    label = operator.get("/api/session").json()["label"]
    with site.websocket("/ws/stick", site.cookie(operator)) as page:
        station.control("")
        page.send(frame(number=1))
        page.send(frame(held=True, number=2))
        page.recv(20)
        assert json.loads(page.recv(20))["on"]
        station.control("grace")
        page.send(frame(held=True, number=3))
        assert json.loads(page.recv(20)) == {
            "n": 3,
            "by": "web",
            "on": False,
            "why": "someone else has control",
        }
        assert station.sticks[-1] == (STILL, False)
        station.control(label)
        page.send(frame(held=True, number=4))
        assert not json.loads(page.recv(20))["on"], "it must be released and pressed again"
        page.send(frame(number=5))
        page.send(frame(held=True, number=6))
        page.recv(20)
        assert json.loads(page.recv(20))["on"]
    station.control("")


def test_a_closed_page_drops_its_sticks_and_everybody_is_told(
    site: Any, operator: httpx.Client, station: Any, until: Any
) -> None:
    station.sticks.clear()
    with site.websocket("/ws/stick", site.cookie(operator)) as page:
        page.send(frame())
        page.send(frame(held=True))
        page.send(frame(0.5, held=True))
        until(lambda: len(station.sticks) == 3)
    until(lambda: len(station.sticks) == 4)
    assert station.sticks[2:] == [((0.5, 0.0, 0.0, 0.0), True), (STILL, False)]
    lines = [event["text"] for event in operator.get("/api/events").json()]
    label = operator.get("/api/session").json()["label"]
    assert f"sticks of {label} dropped: the page closed" in lines


@pytest.mark.parametrize("cause", range(1, len(CAUSES)))
def test_the_cause_a_page_gives_is_told(
    site: Any, operator: httpx.Client, station: Any, cause: int
) -> None:
    with site.websocket("/ws/stick", site.cookie(operator)) as page:
        for number, held in ((1, False), (2, True), (3, False)):
            page.send(frame(held=held, number=number, cause=0 if held else cause))
            page.recv(20)
    assert operator.get("/api/events").json()[-1]["text"].endswith(f"dropped: {CAUSES[cause]}")


def test_a_viewer_has_no_sticks(site: Any, viewer: httpx.Client) -> None:
    import websockets.exceptions

    with pytest.raises(websockets.exceptions.InvalidStatus):
        site.websocket("/ws/stick", site.cookie(viewer))
