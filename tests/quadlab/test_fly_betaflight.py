"""Flights on the real Betaflight in simulated time, and its behavior without commands."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from flight_log import read_log, read_metadata
from quadlab.__main__ import main
from quadlab.simulated.experiment import with_options
from quadlab.simulated.flight import SimulatedFlight
from quadlab.simulated.flight_log import FlightLog
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import LinkError
from quadrotor.parameters import ParameterStore
from vehicle.boards.betaflight.board import KIND
from vehicle.boards.betaflight.options import BetaflightOptions
from vehicle.processes import mailbox
from vehicle.simulator.betaflight.firmware import BetaflightFirmware
from vehicle.simulator.betaflight.process import FIRMWARE
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

pytestmark = pytest.mark.skipif(
    not FIRMWARE.exists(), reason="no Betaflight: scripts/betaflight builds it"
)
LANDING_SPEED = 0.8
"""Vertical speed at touch-down, m/s."""


def test_the_eight_stays_within_its_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["fly", "figure_eight", "--board", "betaflight", "--out", str(tmp_path), "--json"]
    assert main(words) == 0
    report: dict[str, Any] = json.loads(capsys.readouterr().out.strip().splitlines()[-1])
    assert report["verdict"] == "passed"
    assert report["metrics"]["position_rms_m"] <= 0.025
    assert report["metrics"]["samples"] > 1500
    log = Path(report["log"])
    assert read_metadata(log)["quadlab.run"]["board"] == "betaflight"
    topics = {message.topic.rpartition("/")[2] for message in read_log(log)}
    assert topics >= {"state", "reference", "imu", "actuators", "status", "battery", "truth"}


def test_a_board_that_is_not_known_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", "hover", "--board", "naze"]) == 2
    said = capsys.readouterr().err
    assert "--board 'naze' is not known; there are mikrokopter, betaflight" in said


class Hovering:
    """Vehicle in the air at 1 m."""

    ALONE = 22.0
    """Time, s, within which the board has landed and stopped its motors."""

    def __init__(self, folder: Path) -> None:
        options = BetaflightOptions()
        parameters = with_options(FlightParameters().model_copy(deep=True), {"board": options})
        store = ParameterStore(parameters)
        store.preset(
            KIND.traits.parameters | {"simulator.imu_rate": KIND.rate, "behavior.volume_z_max": 3.5}
        )
        self.vehicle = SimulatedVehicle(parameters.simulator, firmware=BetaflightFirmware(options))
        self.log = FlightLog(folder / "hover.mcap", "quad1", store, {})
        self.flight = flight = SimulatedFlight(parameters, self.vehicle, self.log, kind=KIND)
        flight.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
        flight.wait(0.5)
        flight.arm()
        flight.wait(1.0)
        flight.start("take_off", height=1.0)
        flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=20)

    @property
    def height(self) -> float:
        return float(self.vehicle.truth["position_w"][0, 2])

    def fly_to(self, height: float) -> None:
        self.flight.start("fly_to", x=0.0, y=0.0, z=height, yaw=0.0)
        self.flight.wait_until(lambda v: v.behavior == "hover", what="hover", timeout=30)
        self.flight.wait(1.0)

    def left_alone(self) -> float:
        """Run board and plant without the flight stack; return the fastest descent in m/s."""
        return self.until_landed(self.vehicle.step, lambda: not any(self.motors))

    @property
    def motors(self) -> Sequence[float]:
        """Return the references of the motors."""
        return self.vehicle.firmware.references

    def until_landed(self, advance: Callable[[], object], is_done: Callable[[], bool]) -> float:
        """Continue until it has landed and `is_done`; return the fastest descent in m/s."""
        fastest = 0.0
        for _ in range(round(1000 * self.ALONE)):
            advance()
            fastest = max(fastest, -float(self.vehicle.truth["velocity_w"][0, 2]))
            if self.height < 0.02 and is_done():
                return fastest
        raise AssertionError(f"{self.height:.2f} m high after {self.ALONE} s, motors {self.motors}")


@pytest.fixture
def hovering(tmp_path: Path) -> Iterator[Hovering]:
    made = Hovering(tmp_path)
    yield made
    made.log.close()
    made.vehicle.close()


@pytest.mark.parametrize("height", [1.0, 3.0])
def test_it_lands_by_itself_when_the_flight_process_is_gone(
    hovering: Hovering, height: float
) -> None:
    if height > hovering.height + 0.5:
        hovering.fly_to(height)
    assert hovering.height == pytest.approx(height, abs=0.05)
    assert hovering.left_alone() <= LANDING_SPEED
    assert abs(hovering.height) < 0.02


def test_it_lands_by_itself_when_its_port_is_pulled(hovering: Hovering) -> None:
    hovering.flight.change({"simulator.unplugged_port": "first"})
    with pytest.raises(LinkError):
        hovering.flight.wait(1.0)
    assert hovering.left_alone() <= LANDING_SPEED
    assert abs(hovering.height) < 0.02


@pytest.mark.parametrize("lost", ["_next_heartbeat_ns", "_next_truth_ns"])
def test_a_silent_link_or_a_lost_tracker_lands_it_from_2_m(hovering: Hovering, lost: str) -> None:
    hovering.fly_to(2.0)
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
