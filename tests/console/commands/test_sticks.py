"""Sticks at the station: silence drops, and a drop or a refusal latches until the dead-man was
released.
"""

from __future__ import annotations

import time
from typing import Any

from console.commands.stick_control import StickHandler
from console.commands.stick_watchdog import DROPPED, REPEATS, StickOrder, StickWatchdog
from vehicle_link.messages import encode, header, new
from vehicle_link.transport.publisher import Received

PUSHED = (0.5, 0.0, -0.2, 1.0)
TIMEOUT = 0.25


def test_held_sticks_go_through() -> None:
    sticks = StickWatchdog()
    assert sticks.feed(PUSHED, True, 0.0, TIMEOUT) == StickOrder(PUSHED, True)
    assert sticks.tick(0.2, TIMEOUT) is None
    assert sticks.feed(PUSHED, True, 0.24, TIMEOUT).enabled


def test_released_sticks_are_centred() -> None:
    assert StickWatchdog().feed(PUSHED, False, 0.0, TIMEOUT) == DROPPED


def test_silence_drops_the_sticks_several_times_and_then_keeps_quiet() -> None:
    sticks = StickWatchdog()
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    orders = [sticks.tick(0.26 + 0.05 * i, TIMEOUT) for i in range(REPEATS + 2)]
    assert orders == [DROPPED] * REPEATS + [None, None]
    assert sticks.dropped


def test_a_dead_man_held_through_a_break_does_not_count_until_released() -> None:
    sticks = StickWatchdog()
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    assert sticks.tick(0.3, TIMEOUT) == DROPPED
    assert sticks.feed(PUSHED, True, 0.31, TIMEOUT) == DROPPED
    assert sticks.feed(PUSHED, False, 0.32, TIMEOUT) == DROPPED
    assert sticks.feed(PUSHED, True, 0.33, TIMEOUT).enabled


def test_a_break_is_noticed_also_when_no_tick_came_between() -> None:
    sticks = StickWatchdog()
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    assert sticks.feed(PUSHED, True, 0.3, TIMEOUT) == DROPPED


def test_silence_of_released_sticks_is_no_drop() -> None:
    sticks = StickWatchdog()
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    sticks.feed(PUSHED, False, 0.1, TIMEOUT)
    orders = [sticks.tick(0.1 + 0.05 * i, TIMEOUT) for i in range(REPEATS + 1)]
    assert orders == [DROPPED] * (REPEATS - 1) + [None, None], "a lost order must not go on"
    assert not sticks.dropped
    assert sticks.tick(10.0, TIMEOUT) is None
    assert sticks.feed(PUSHED, True, 10.0, TIMEOUT).enabled


def test_a_drop_is_due_when_the_silence_is_over_and_nothing_is_due_without_sticks() -> None:
    sticks = StickWatchdog()
    assert sticks.due(0.0, TIMEOUT) is None
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    wait = sticks.due(0.1, TIMEOUT)
    assert wait is not None
    assert sticks.tick(0.1 + wait - 1e-3, TIMEOUT) is None
    assert sticks.tick(0.1 + wait, TIMEOUT) == DROPPED
    assert sticks.due(1.0, TIMEOUT) is None


def test_a_new_press_ends_the_repeats_of_the_drop_before() -> None:
    sticks = StickWatchdog()
    sticks.feed(PUSHED, True, 0.0, TIMEOUT)
    assert sticks.tick(0.3, TIMEOUT) == DROPPED
    sticks.feed(PUSHED, False, 0.31, TIMEOUT)
    assert sticks.feed(PUSHED, True, 0.32, TIMEOUT).enabled
    assert sticks.tick(0.33, TIMEOUT) is None, "it must not stop the sticks that are held now"


class Sent:
    """Messages that a station publishes about sticks."""

    def __init__(self) -> None:
        self.orders: list[StickOrder] = []
        self.answers: list[tuple[bool, str]] = []

    def joy(self, axes: tuple[float, float, float, float], enabled: bool) -> None:
        self.orders.append(StickOrder(axes, enabled))

    def message(self, name: str, message: Any, stamp_ns: int) -> None:
        self.answers.append((message.enabled, message.reason))


def test_sticks_held_while_another_had_control_need_a_release_when_control_comes() -> None:
    sent, holder, asked = Sent(), ["grace"], []

    def accepts(requester: str, enabled: bool) -> bool:
        asked.append(requester)
        return requester == holder[0]

    handler = StickHandler(sent, accepts, lambda order: True, lambda: 60.0)  # type: ignore[arg-type]

    def send(held: bool) -> tuple[bool, str]:
        now_ns = time.time_ns()
        joy = new("sensor_msgs/Joy", header=header(now_ns, "ada"), axes=PUSHED, buttons=[int(held)])
        handler.received(Received(encode(joy), 1, now_ns, now_ns))
        return sent.answers[-1]

    try:
        assert send(held=True) == (False, "someone else has control")
        holder[0], asked[:] = "ada", []
        assert send(held=True) == (False, "release the dead-man button and press it again")
        assert asked == [], "they must not take control either"
        assert sent.orders == []
        assert send(held=False) == (False, "")
        assert send(held=True) == (True, "")
        assert [order.enabled for order in sent.orders] == [False, True]
    finally:
        handler.close()
