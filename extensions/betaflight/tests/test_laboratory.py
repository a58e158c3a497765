"""Tests of `quadlab up --board betaflight`: the real firmware under the whole laboratory."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from flight_log import read_log
from tests.system.conftest import Laboratory
from vehicle_link.topics.ticks import decode_odometry

pytestmark = [pytest.mark.timeout(300), pytest.mark.needs("betaflight")]
LANDING_SPEED = 0.8
"""Landing speed, m/s."""
LANDED = 60.0
"""Time, in s, in which the board has landed and was checked again, on a busy computer."""


@pytest.fixture(scope="module")
def betaflight(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Laboratory]:
    words = ["--board", "betaflight", "--set", "board.landing_speed=0.4"]
    made = Laboratory(tmp_path_factory.mktemp("betaflight") / "data", *words)
    try:
        yield made.sign_in()
    finally:
        made.close()


def test_it_is_checked_flies_waits_for_a_slow_part_and_lands_alone_when_flight_is_killed(
    betaflight: Laboratory,
) -> None:
    lab = betaflight
    lab.hover()
    assert any(line.endswith(" good") for line in lab.lines), "it was not checked"
    flight = lab.pid("flight")
    assert flight is not None
    for _ in range(3):
        os.kill(flight, signal.SIGSTOP)
        # Without sticks the board would land after 0.2 s.
        threading.Event().wait(0.6)
        os.kill(flight, signal.SIGCONT)
        threading.Event().wait(0.3)
    lab.reach(mode="armed", behavior="hover")
    run = lab.newest("runs")
    killed = lab.now()
    dead = lab.kill("flight")
    lab.restarted("flight", dead)
    lab.reach(2 * LANDED, mode="ready")  # it is armed only after it was checked again
    states = [decode_odometry(m.payload) for m in read_log(run, {"/quad1/truth"})]
    later = [state for stamp, state in states if stamp * 1e-9 > killed]
    heights = np.array([state["position_w"][0, 2] for state in later])
    assert heights[0] == pytest.approx(1.0, abs=0.1)
    assert abs(heights[-1]) < 0.05
    assert 0.0 < max(-state["velocity_w"][0, 2] for state in later) < LANDING_SPEED
