"""Sticks act only while their button is held, never by themselves, and for one hand at a time."""

from __future__ import annotations

import struct
from typing import Any

import httpx
import pytest

from web.sticks import SILENCE, Axes, Hand, StickOutput


def frame(forward: float = 0.0, left: float = 0.0, up: float = 0.0, yaw: float = 0.0,
          held: bool = False) -> bytes:  # fmt: skip
    return struct.pack("<5f", forward, left, up, yaw, float(held))


def test_a_button_held_from_the_start_does_not_count() -> None:
    hand = Hand()
    assert hand.take(frame(held=True), 0.00) == ((0, 0, 0, 0), False)
    assert hand.take(frame(held=True), 0.02)[1] is False
    assert hand.take(frame(held=False), 0.04)[1] is False
    assert hand.take(frame(held=True), 0.06)[1] is True


def test_after_a_silence_the_button_must_be_released_again() -> None:
    hand = Hand()
    hand.take(frame(), 0.0)
    assert hand.take(frame(held=True), 0.02)[1] is True
    assert hand.take(frame(held=True), 0.02 + SILENCE + 0.01)[1] is False
    assert hand.take(frame(held=True), 0.30 + SILENCE)[1] is False
    hand.take(frame(), 0.32 + SILENCE)
    assert hand.take(frame(held=True), 0.34 + SILENCE)[1] is True


def test_axes_are_clamped() -> None:
    assert Hand().take(frame(5.0, -5.0, 0.5, 1.0), 0.0)[0] == (1.0, -1.0, 0.5, 1.0)


@pytest.mark.parametrize(
    "raw", [b"", b"x" * 19, frame(float("nan")), struct.pack("<5f", 0, 0, 0, 0, float("inf"))]
)
def test_what_is_no_frame_is_refused(raw: bytes) -> None:
    with pytest.raises(ValueError, match="stick frame"):
        Hand().take(raw, 0.0)


class Desk:
    """An output with a clock in hand and what it published."""

    def __init__(self) -> None:
        self.now = 0.0
        self.published: list[tuple[Axes, bool]] = []
        self.output = StickOutput(lambda *sent: self.published.append(sent), lambda: self.now)


def test_one_hand_keeps_the_sticks_until_it_lets_go() -> None:
    desk, one, two = Desk(), object(), object()
    assert desk.output.send(one, (1, 0, 0, 0), True)
    assert not desk.output.send(two, (0, 1, 0, 0), True)
    assert desk.published == [((1, 0, 0, 0), True)]
    assert desk.output.send(one, (0, 0, 0, 0), False)
    assert desk.published[-1] == ((0, 0, 0, 0), False)
    assert desk.output.send(two, (0, 1, 0, 0), True)


def test_a_silent_hand_loses_the_sticks() -> None:
    desk, one, two = Desk(), object(), object()
    desk.output.send(one, (1, 0, 0, 0), True)
    desk.now += SILENCE + 0.01
    assert desk.output.send(two, (0, 1, 0, 0), True)
    desk.output.release(one)  # its page closed later: the other's sticks stay
    assert desk.published[-1] == ((0, 1, 0, 0), True)


def test_a_hand_that_never_enabled_publishes_nothing() -> None:
    desk = Desk()
    desk.output.send(object(), (1, 0, 0, 0), False)
    assert desk.published == []


def test_a_closed_page_drops_its_sticks(
    site: Any, operator: httpx.Client, station: Any, until: Any
) -> None:
    station.sticks.clear()
    with site.websocket("/ws/stick", site.cookie(operator)) as page:
        page.send(frame())
        page.send(frame(0.5, held=True))
        until(lambda: bool(station.sticks))
    until(lambda: len(station.sticks) == 2)
    assert station.sticks == [((0.5, 0.0, 0.0, 0.0), True), ((0.0, 0.0, 0.0, 0.0), False)]


def test_a_viewer_has_no_sticks(site: Any, viewer: httpx.Client) -> None:
    import websockets.exceptions

    with pytest.raises(websockets.exceptions.InvalidStatus):
        site.websocket("/ws/stick", site.cookie(viewer))
