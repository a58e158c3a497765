"""Events without a station on the link are published once there is one."""

from __future__ import annotations

import math

from vehicle.comms.deferred_events import CAPACITY, CONNECTED_FOR, SILENT_AFTER, DeferredEvents
from vehicle.mailbox import ERROR, INFO, WARN, Event
from vehicle_link.commands import EventKind
from vehicle_link.topics.status import DELAYED_PREFIX

BRAKING = Event(1, WARN, "braking: a", frozenset({EventKind.BRAKING}))
LANDING = Event(2, ERROR, "emergency land: b")


def test_warnings_of_a_silence_are_told_once_when_it_is_over_and_settled() -> None:
    unheard = DeferredEvents()
    assert unheard.due(0.0, 0.05, 7) is None
    assert unheard.defer(BRAKING, 0.4)
    assert unheard.defer(LANDING, 2.4)
    assert unheard.due(5.0, 5.0, 7) is None
    assert unheard.due(10.0, 0.05, 7) is None, "nobody may listen yet"
    assert unheard.due(10.0 + CONNECTED_FOR - 0.1, 0.05, 7) is None
    told = unheard.due(10.0 + CONNECTED_FOR, 0.05, 7)
    text = f"{DELAYED_PREFIX}{BRAKING.text}; {LANDING.text}"
    assert told == Event(7, ERROR, text, frozenset({EventKind.BRAKING, EventKind.DELAYED}))
    assert unheard.due(99.0, 0.05, 7) is None


def test_a_link_that_comes_and_goes_is_waited_for() -> None:
    unheard = DeferredEvents()
    unheard.defer(LANDING, 2.4)
    assert unheard.due(10.0, 0.0, 7) is None
    assert unheard.due(12.0, SILENT_AFTER + 0.1, 7) is None
    assert unheard.due(12.5, 0.0, 7) is None
    assert unheard.due(10.0 + CONNECTED_FOR, 0.0, 7) is None
    assert unheard.due(12.5 + CONNECTED_FOR, 0.0, 7) is not None


def test_what_was_heard_or_is_no_warning_or_before_any_station_is_not_kept() -> None:
    unheard = DeferredEvents()
    assert not unheard.defer(LANDING, 0.05)
    assert not unheard.defer(Event(1, INFO, "touched down"), 5.0)
    assert not unheard.defer(LANDING, math.inf)
    unheard.due(0.0, 0.0, 7)
    assert unheard.due(CONNECTED_FOR, 0.0, 7) is None


def test_of_many_the_newest_are_told() -> None:
    unheard = DeferredEvents()
    for k in range(CAPACITY + 5):
        unheard.defer(Event(k, WARN, f"<{k}>"), 1.0)
    unheard.due(0.0, 0.0, 7)
    told = unheard.due(CONNECTED_FOR, 0.0, 7)
    assert told is not None
    assert told.level == WARN
    shown = [f"<{k}>" in told.text for k in (4, 5, CAPACITY + 4)]
    assert shown == [False, True, True]
