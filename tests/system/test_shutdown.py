"""Ctrl-C lands a flying vehicle first, closes every file, and leaves no process behind."""

from __future__ import annotations

import os
import signal
import threading
from typing import Any

import pytest

from flight_log import is_closed, read_log
from vehicle_link.messages import decode
from vehicle_link.topics.ticks import decode_odometry

INFO = 20
pytestmark = pytest.mark.timeout(240)


def test_parts_without_time_are_waited_for_a_second_up_is_refused_and_ctrl_c_lands_first(
    lab: Any,
) -> None:
    lab.hover()
    begun_ns = round(1e9 * lab.now())
    for part in ("flight", "comms", "station"):
        pid = lab.pid(part)
        for _ in range(3):
            os.kill(pid, signal.SIGSTOP)
            # Without answers the microcontroller would land after 0.25 s.
            threading.Event().wait(0.6)
            os.kill(pid, signal.SIGCONT)
            threading.Event().wait(0.3)
        lab.reach(mode="armed", behavior="hover")
    frozen_until_ns = round(1e9 * lab.now())

    second = type(lab)(lab.data)  # on the same data folder
    try:
        assert second.wait() == 1
    finally:
        second.close()
    lines = [line for line in second.lines if line]
    assert len(lines) == 1, lines
    assert "another quadlab up" in lines[0]
    assert "--data" in lines[0]

    lab.reach(mode="armed", behavior="hover")  # the first laboratory continues
    assert lab.stop() == 0, lab.output
    assert "landing before stopping" in lab.output
    assert lab.processes() == {}
    recorded, onboard = lab.newest("runs"), lab.newest("onboard")
    assert is_closed(recorded)
    assert is_closed(onboard)
    heights = [
        decode_odometry(m.payload)[1]["position_w"][0, 2]
        for m in read_log(onboard, {"/quad1/state"})
    ]
    assert max(heights) == pytest.approx(1.0, abs=0.1)
    assert heights[-1] == pytest.approx(0.0, abs=0.05), "stopped in the air"
    told = [
        event.msg
        for path in (onboard, recorded)
        for m in read_log(path, {"/quad1/events"})
        if begun_ns < m.publish_ns < frozen_until_ns
        and (event := decode(m.payload, "rcl_interfaces/Log")).level > INFO
    ]
    assert told == [], "of the parts that got no time"
