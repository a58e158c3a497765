"""Events without a station on the link are published once there is one."""

from __future__ import annotations

import math

from vehicle.comms.deferred_events import MOST, SETTLED, SILENT, Unheard
from vehicle.processes.mailbox import ERROR, INFO, WARN, Event
from vehicle_link.topics import DELAYED_PREFIX

BRAKING, LANDING = Event(1, WARN, "braking: a"), Event(2, ERROR, "emergency land: b")


def test_warnings_of_a_silence_are_told_once_when_it_is_over_and_settled() -> None:
    unheard = Unheard()
    assert unheard.due(0.0, 0.05) is None
    assert unheard.said(BRAKING, 0.4)
    assert unheard.said(LANDING, 2.4)
    assert unheard.due(5.0, 5.0) is None
    assert unheard.due(10.0, 0.05) is None, "nobody may listen yet"
    assert unheard.due(10.0 + SETTLED - 0.1, 0.05) is None
    told = unheard.due(10.0 + SETTLED, 0.05)
    assert told == (ERROR, f"{DELAYED_PREFIX}{BRAKING.text}; {LANDING.text}")
    assert unheard.due(99.0, 0.05) is None


def test_a_link_that_comes_and_goes_is_waited_for() -> None:
    unheard = Unheard()
    unheard.said(LANDING, 2.4)
    assert unheard.due(10.0, 0.0) is None
    assert unheard.due(12.0, SILENT + 0.1) is None
    assert unheard.due(12.5, 0.0) is None
    assert unheard.due(10.0 + SETTLED, 0.0) is None
    assert unheard.due(12.5 + SETTLED, 0.0) is not None


def test_what_was_heard_or_is_no_warning_or_before_any_station_is_not_kept() -> None:
    unheard = Unheard()
    assert not unheard.said(LANDING, 0.05)
    assert not unheard.said(Event(1, INFO, "touched down"), 5.0)
    assert not unheard.said(LANDING, math.inf)
    unheard.due(0.0, 0.0)
    assert unheard.due(SETTLED, 0.0) is None


def test_of_many_the_newest_are_told() -> None:
    unheard = Unheard()
    for k in range(MOST + 5):
        unheard.said(Event(k, WARN, f"<{k}>"), 1.0)
    unheard.due(0.0, 0.0)
    level, text = unheard.due(SETTLED, 0.0) or (0, "")
    assert level == WARN
    assert ("<4>" in text, "<5>" in text, f"<{MOST + 4}>" in text) == (False, True, True)
