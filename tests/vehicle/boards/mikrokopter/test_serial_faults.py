"""Serial lines that damage bytes or are unplugged, in flight and in simulated time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.flights.failing_flights import FailingFlight, watch_failure
from benchmarks.flights.touch_down import Outcome
from quadrotor.errors import LinkError
from vehicle.modes import ControlMode, Mode
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.serial_faults import configure_wires, new_wires
from vehicle_link.serial.ids import Id
from vehicle_link.serial.port import memory_port_pair


def damaged(seed: int, share: float, count: int = 20_000) -> np.ndarray:
    """Return which of `count` bytes sent to the vehicle arrive changed."""
    here, there = memory_port_pair()
    [wire] = new_wires([there], SimulatorParameters(seed=seed, corrupted_bytes=share))
    sent = bytes(range(200))
    arrived = b""
    for _ in range(count // len(sent)):
        wire.write(sent)
        arrived += here.read()
    sent *= count // len(sent)
    return np.asarray(np.frombuffer(arrived, np.uint8) != np.frombuffer(sent, np.uint8))


def test_the_share_of_bytes_asked_for_is_damaged_the_same_for_a_seed() -> None:
    hit = damaged(seed=3, share=0.05)
    assert hit.mean() == pytest.approx(0.05, abs=0.005)
    assert np.array_equal(hit, damaged(seed=3, share=0.05))
    assert not np.array_equal(hit, damaged(seed=4, share=0.05))
    assert not damaged(seed=3, share=0.0).any()


def test_a_wire_is_damaged_both_ways_and_pulled_out_by_its_parameter() -> None:
    pairs = [memory_port_pair() for _ in range(2)]
    parameters = SimulatorParameters(corrupted_bytes=0.5)
    wires = new_wires([far for _, far in pairs], parameters)
    pairs[0][0].write(bytes(200))
    assert wires[0].read() != bytes(200)
    parameters.unplugged_port, parameters.corrupted_bytes = "second", 0.0
    configure_wires(wires, parameters)
    for wire, (near, _) in zip(wires, pairs, strict=True):
        wire.write(b"there?\r")
        assert wire.read() == b""
        if wire is wires[0]:
            assert near.read() == b"there?\r"
    with pytest.raises(LinkError, match="is gone: pulled out"):
        pairs[1][0].read()
    with pytest.raises(LinkError, match="is gone: pulled out"):
        pairs[1][0].write(b"x")
    parameters.unplugged_port = "none"
    configure_wires(wires, parameters)
    wires[1].write(b"again\r")
    assert pairs[1][0].read() == b"again\r"


@pytest.mark.parametrize("seed", [1, 4])
def test_with_5_percent_of_all_bytes_damaged_it_flies_the_8_on_and_lands(seed: int) -> None:
    print(f"seed {seed}")
    flight = FailingFlight(seed).hover(settling=0.0)
    flight.start("follow_trajectory", trajectory="figure_eight", laps=2)
    flight.wait(3.0)
    flight.forget()
    flight.disturb(corrupted_bytes=0.05)
    flight.wait(8.0)
    assert flight.stack.mode is Mode.ARMED
    assert flight.stack.modes.control_mode is ControlMode.DIRECT
    times, true, wanted = flight.trace()
    off = np.linalg.norm(true - wanted, axis=1)
    assert len(times) > 3000
    assert off.max() < 0.25
    assert math.sqrt(np.mean(off**2)) < 0.08
    errors = int(flight.robot.firmware.registers[Id.CRC_ERRORS])
    assert errors > 200, "counted by the microcontroller"
    assert flight._board.damaged > 2000, "counted by the vehicle"
    flight.start("land")
    assert flight.down()
    assert flight.hardest < 0.8


@pytest.mark.parametrize("failure", ["port 0", "port 1", "both ports"])
def test_a_port_pulled_in_flight_is_landed(failure: str) -> None:
    flight = FailingFlight(2).hover(settling=0.0)
    outcome = Outcome(failure, "hover 1 m", 2)
    watch_failure(flight, failure, outcome)
    assert outcome.verdict == "landed", outcome
    assert outcome.drift < 0.5
    alone = failure == "both ports"
    assert flight.frozen is alone, "the flight process ends with its last port"
    told = any("a serial port is lost" in text for text in flight.events.texts)
    assert told == (not alone)
