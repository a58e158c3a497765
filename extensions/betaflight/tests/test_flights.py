"""Flights on the real Betaflight in simulated time, and its behavior without commands."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from console.experiments import figure_eight
from extensions.betaflight.simulated.firmware import BetaflightFirmware
from flight_log import read_log, read_metadata
from quadlab.__main__ import main
from quadrotor.errors import LinkError
from tests.quadlab.fly.hovering import Hovering
from vehicle import mailbox

pytestmark = pytest.mark.needs("betaflight")
LANDING_SPEED = 0.8
"""Vertical speed at touch-down, m/s."""


def test_the_eight_stays_within_its_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figure_eight, "LAPS", 2)  # of which one is steady
    words = ["fly", "figure_eight", "--board", "betaflight", "--out", str(tmp_path), "--json"]
    assert main(words) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    assert report["verdict"] == "passed"
    assert report["metrics"]["position_rms_m"] <= 0.025
    assert report["metrics"]["samples"] > 700
    log = Path(report["log"])
    assert read_metadata(log)["quadlab.run"]["board"] == "betaflight"
    topics = {message.topic.rpartition("/")[2] for message in read_log(log)}
    assert topics >= {"state", "reference", "imu", "actuators", "status", "battery", "truth"}


def test_a_board_that_is_not_known_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", "hover", "--board", "naze"]) == 2
    said = capsys.readouterr().err
    assert "--board 'naze' is not known; there are mikrokopter, betaflight, crazyflie" in said


@pytest.fixture
def hovering(tmp_path: Path) -> Iterator[Hovering]:
    made = Hovering(tmp_path, "betaflight", landing_time=6)
    yield made
    made.log.close()
    made.vehicle.close()


def test_by_its_angles_it_flies_the_eight_and_lands_by_itself_from_3_m(tmp_path: Path) -> None:
    hovering = Hovering(tmp_path, "betaflight", landing_time=12, level="angles")
    flight, errors = hovering.flight, []
    flight.start("follow_trajectory", trajectory="figure_eight", laps=2)
    flight.wait(4.0)  # the ramp
    end_ns = flight.stack.stamp_ns + 8_000_000_000
    while flight.stack.stamp_ns < end_ns:
        flight.advance()
        reference_w = flight.stack.reference["position_w"][0]
        errors.append(hovering.vehicle.truth["position_w"][0] - reference_w)
    assert np.sqrt(np.mean(np.sum(np.square(errors), axis=1))) <= 0.05
    flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)
    hovering.fly_to(3.0)
    assert hovering.height == pytest.approx(3.0, abs=0.05)
    assert hovering.left_alone() <= LANDING_SPEED  # the flight process is gone
    assert abs(hovering.height) < 0.02
    hovering.log.close()
    hovering.vehicle.close()


def test_it_lands_by_itself_when_its_port_is_pulled(hovering: Hovering) -> None:
    hovering.flight.change({"simulator.unplugged_port": "first"})
    with pytest.raises(LinkError):
        hovering.flight.wait(1.0)
    assert hovering.left_alone() <= LANDING_SPEED
    assert abs(hovering.height) < 0.02


@pytest.mark.parametrize("lost", ["_next_heartbeat_ns", "_next_truth_ns"])
def test_a_silent_link_or_a_lost_tracker_lands_it(hovering: Hovering, lost: str) -> None:
    flight = hovering.flight
    setattr(flight, lost, 10**18)  # the station's heartbeat, or the tracker's poses
    sinking = hovering.until_landed(flight.advance, lambda: flight.view().mode == "ready")
    assert sinking <= LANDING_SPEED
    assert abs(hovering.height) < 0.02


def test_a_board_that_fails_turns_no_motor_and_tells_nothing_more(hovering: Hovering) -> None:
    firmware = hovering.vehicle.firmware
    assert isinstance(firmware, BetaflightFirmware)
    firmware.fail()
    newest_ns = hovering.flight.stack.stamp_ns
    for _ in range(1000):
        hovering.flight.advance()
    assert not any(firmware.references)
    assert abs(hovering.height) < 0.05
    assert hovering.flight.stack.stamp_ns - newest_ns < 10_000_000


def test_an_emergency_landing_is_the_boards_own(hovering: Hovering) -> None:
    flight = hovering.flight
    reply = flight.stack.handle(mailbox.Emergency("1", "test", "land"))
    assert reply.accepted
    sinking = hovering.until_landed(flight.advance, lambda: not any(hovering.motors))
    assert sinking <= LANDING_SPEED
    assert abs(hovering.height) < 0.02
