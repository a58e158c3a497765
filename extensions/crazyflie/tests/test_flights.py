"""Flights on the simulated Crazyflie in simulated time."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from console.experiments import figure_eight
from flight_log import read_log, read_metadata
from quadlab.__main__ import main
from tests.quadlab.fly.hovering import Hovering
from vehicle import mailbox

LANDING_SPEED = 0.8
"""Vertical speed at touch-down, m/s."""


def test_the_eight_stays_within_its_errors_over_a_radio(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figure_eight, "LAPS", 2)  # of which one is steady
    words = ["fly", "figure_eight", "--board", "crazyflie", "--out", str(tmp_path), "--json"]
    assert main(words) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    assert report["verdict"] == "passed"
    assert report["metrics"]["position_rms_m"] <= 0.04
    log = Path(report["log"])
    assert read_metadata(log)["quadlab.run"]["board"] == "crazyflie"
    topics = {message.topic.rpartition("/")[2] for message in read_log(log)}
    assert topics >= {"state", "reference", "imu", "actuators", "status", "battery", "truth"}


@pytest.fixture
def hovering(tmp_path: Path) -> Iterator[Hovering]:
    made = Hovering(tmp_path, "crazyflie")
    yield made
    made.log.close()
    made.vehicle.close()


def test_silent_in_flight_it_is_landed_by_whoever_has_the_radio(hovering: Hovering) -> None:
    assert hovering.left_alone() <= LANDING_SPEED
    assert abs(hovering.height) < 0.02


def test_without_its_radio_it_levels_out_and_falls_after_2_s(hovering: Hovering) -> None:
    vehicle = hovering.vehicle
    hovering.flight.change({"simulator.unplugged_port": "first"})
    for _ in range(1900):
        vehicle.step()
    assert hovering.height > 0.5
    assert any(hovering.motors)
    for _ in range(1500):
        vehicle.step()
    assert not any(hovering.motors)
    assert hovering.height < 0.02


def test_without_the_tracker_it_descends_by_its_barometer(hovering: Hovering) -> None:
    flight = hovering.flight
    flight._next_truth_ns = 10**18
    sinking = hovering.until_landed(flight.advance, lambda: flight.view().mode == "ready")
    assert sinking <= LANDING_SPEED


def test_given_up_it_descends_level_by_set_points(hovering: Hovering) -> None:
    flight = hovering.flight
    flight.stack.modes.hand_over("a test")
    sinking = hovering.until_landed(flight.advance, lambda: flight.view().mode == "ready")
    assert sinking <= 1.0  # with 4 % less thrust than weight, from 1 m


def test_a_cut_stops_the_motors_at_once(hovering: Hovering) -> None:
    flight = hovering.flight
    assert flight.stack.handle(mailbox.Emergency("1", "test", "cut")).accepted
    flight.wait(0.1)
    assert not any(hovering.motors)


def test_what_needs_single_motors_is_refused_with_the_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["fly", "motor_bench", "--board", "crazyflie", "--out", str(tmp_path), "--json"]
    main(words)
    said = "".join(capsys.readouterr())
    assert "board crazyflie takes body rates and collective thrust or roll, pitch" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--serial", "radio://0/200/2M"], "a channel of 0 to 125, 250K, 1M or 2M"),
        (["--serial", "udp://x"], "give one like udp://127.0.0.1:19850"),
        ([], "--serial has 0 ports; --board crazyflie --check reads one, like --serial radio://0"),
        (
            ["--serial", "udp://127.0.0.1:19850", "--set", "board.thrust=1"],
            "did you mean thrust_max",
        ),
    ],
)
def test_wrong_words_of_a_check_are_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["vehicle", "--board", "crazyflie", "--check", *words]) != 0
    error = capsys.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1


def test_one_that_does_not_fit_ends_the_flight_with_its_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["fly", "hover", "--board", "crazyflie", "--out", str(tmp_path)]
    assert main([*words, "--set", "board.parameters=cpu.flash"]) == 1
    assert "no sample for 10 s: cpu.flash of the Crazyflie is read-only" in capsys.readouterr().err
