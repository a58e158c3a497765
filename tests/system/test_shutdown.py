"""Ctrl-C: lands a flying vehicle first, closes every file, leaves no process behind."""

from __future__ import annotations

from typing import Any

import pytest

from flight_log import is_closed, read_log
from vehicle_link.topics import decode_odometry

pytestmark = pytest.mark.timeout(240)


def test_a_second_up_is_refused_and_ctrl_c_in_flight_lands_first_and_leaves_nothing_behind(
    lab: Any,
) -> None:
    second = type(lab)(lab.data)  # on the same data folder
    try:
        assert second.wait() == 1
    finally:
        second.close()
    lines = [line for line in second.lines if line]
    assert len(lines) == 1, lines
    assert "another quadlab up" in lines[0]
    assert "--data" in lines[0]
    lab.hover()  # the first goes on
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
