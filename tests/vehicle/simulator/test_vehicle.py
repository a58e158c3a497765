"""The simulated vehicle as a whole: only bytes in and out, and the same bytes for a seed."""

from __future__ import annotations

import numpy as np
import pytest

from quadrotor.motor_state import MotorState
from vehicle.boards.board import RawSample
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle

CLIMB = (135, 135, 135, 135)


def fly(seed: int, steps: int) -> tuple[list[RawSample], bytes]:
    """Fly with motors on and constant references; return the samples and the truth at the end."""
    simulated = SimulatedVehicle(SimulatorParameters(seed=seed))
    mcu = Microcontroller(simulated.ports, 0)
    mcu.set_motor_state(MotorState.ON)
    samples = []
    for _ in range(steps):
        simulated.step()
        samples += mcu.receive()
        mcu.command(CLIMB)
        mcu.service(simulated.stamp_ns * 1e-9)
    return samples, simulated.truth.tobytes()


def test_the_same_seed_gives_the_same_flight_to_the_bit() -> None:
    assert fly(5, 1200) == fly(5, 1200)


def test_another_seed_gives_other_noise() -> None:
    assert fly(5, 100)[0] != fly(6, 100)[0]


def test_references_on_the_line_make_it_climb() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    mcu.set_motor_state(MotorState.ON)
    for _ in range(1000):
        simulated.step()
        mcu.receive()
        mcu.command(CLIMB)
        mcu.service(simulated.stamp_ns * 1e-9)
    assert simulated.truth["position_w"][0, 2] > 0.5


@pytest.mark.parametrize("latency", [0.0, 0.03])
def test_a_command_acts_after_its_latency(latency: float) -> None:
    simulated = SimulatedVehicle(SimulatorParameters(command_latency=latency))
    mcu = Microcontroller(simulated.ports, 0)
    mcu.set_motor_state(MotorState.ON)
    for _ in range(100):
        simulated.step()
        mcu.receive()
        mcu.command((20, 20, 20, 20))
        mcu.service(simulated.stamp_ns * 1e-9)
    begun_ns, before = simulated.stamp_ns, simulated.rotor_speeds[0]
    while simulated.rotor_speeds[0] < before + 1.0:
        mcu.command(CLIMB)
        mcu.service(simulated.stamp_ns * 1e-9)
        simulated.step()
        mcu.receive()
    assert 1e-9 * (simulated.stamp_ns - begun_ns) == pytest.approx(latency, abs=0.005)


def test_silence_stops_the_motors_and_is_reported() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    mcu.set_motor_state(MotorState.ON)
    samples = []
    for step in range(700):
        simulated.step()
        samples += mcu.receive()
        if step < 300:
            mcu.command(CLIMB)
            mcu.service(simulated.stamp_ns * 1e-9)
    states = [sample.motor_state for sample in samples]
    assert states[290] is MotorState.ON
    assert states[300 + 124] is MotorState.ON  # 0.25 s after the last command
    assert states[300 + 128] is MotorState.EMERGENCY


def test_the_first_sample_is_at_time_0_and_moves_nothing() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    simulated.place((1.0, 2.0, 3.0))
    simulated.step()
    assert simulated.stamp_ns == 0
    assert simulated.truth["position_w"][0].tolist() == [1.0, 2.0, 3.0]
    simulated.step()
    assert simulated.stamp_ns == 2_000_000
    assert simulated.truth["position_w"][0, 2] < 3.0


@pytest.mark.parametrize("rate", [60, 120, 300, 650, 677, 1000])
def test_the_rate_asked_for_is_flown_and_stamps_on_board_are_the_truth_s(rate: int) -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0, rate=rate)
    period_ns = 1000 * round(1e6 / rate)
    for k in range(rate):
        simulated.step()
        (sample,) = mcu.receive()
        assert simulated.stamp_ns == k * period_ns
        assert sample.stamp_ns == simulated.stamp_ns
    assert mcu.connected


def test_another_rate_while_it_runs_goes_on_from_the_present_sample() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    for _ in range(4):
        simulated.step()
    mcu = Microcontroller(simulated.ports, 0, rate=250)
    stamps = []
    for _ in range(3):
        simulated.step()
        stamps.append(simulated.stamp_ns // 1_000_000)
    assert stamps == [10, 14, 18]
    assert simulated.sample_period_ns == 4_000_000
    assert [sample.stamp_ns // 1_000_000 for sample in mcu.receive()] == [0, 4, 8]


def test_warming_up_changes_nothing() -> None:
    plain, warm = SimulatedVehicle(SimulatorParameters()), SimulatedVehicle(SimulatorParameters())
    warm.warm_up()
    for _ in range(3):
        plain.step()
        warm.step()
    assert [port.read() for port in plain.ports] == [port.read() for port in warm.ports]


def test_a_payload_and_a_gust_act_in_flight() -> None:
    heights, drifts = [], []
    for payload in (0.0, 0.3):
        simulated = SimulatedVehicle(SimulatorParameters())
        mcu = Microcontroller(simulated.ports, 0)
        mcu.set_motor_state(MotorState.ON)
        for step in range(500):
            if step == 250:
                simulated.configure(SimulatorParameters(mass=1.308 + payload))
                simulated.disturb((payload * 10, 0.0, 0.0))
            simulated.step()
            mcu.receive()
            mcu.command((140, 140, 140, 140))
            mcu.service(simulated.stamp_ns * 1e-9)
        heights.append(simulated.truth["position_w"][0, 2])
        drifts.append(simulated.truth["position_w"][0, 0])
    assert heights[1] < heights[0] - 0.1
    assert drifts[1] > drifts[0] + 0.1


def test_skipped_samples_are_a_gap_in_the_stamps() -> None:
    simulated = SimulatedVehicle(SimulatorParameters())
    mcu = Microcontroller(simulated.ports, 0)
    simulated.step()
    simulated.skip(1000)
    samples = mcu.receive()
    for _ in range(3):
        simulated.step()
        samples += mcu.receive()
    # The first one after the gap is regarded as damaged until the next confirms it.
    assert [sample.stamp_ns for sample in samples] == [0, 2_004_000_000, 2_006_000_000]


def test_lost_samples_are_lost_at_their_share_and_the_others_keep_their_stamps() -> None:
    kept: dict[float, dict[int, RawSample]] = {}
    for lost in (0.0, 0.1):
        simulated = SimulatedVehicle(SimulatorParameters(lost_samples=lost, seed=3))
        mcu = Microcontroller(simulated.ports, 0)
        kept[lost] = {}
        for _ in range(2000):
            simulated.step()
            kept[lost] |= {sample.stamp_ns: sample for sample in mcu.receive()}
    assert len(kept[0.0]) == 2000
    assert len(kept[0.1]) == pytest.approx(1800, abs=60)
    assert all(kept[0.0][stamp] == sample for stamp, sample in kept[0.1].items())


def test_sensors_warm_up_with_time() -> None:
    simulated = SimulatedVehicle(
        SimulatorParameters(gyroscope_warm_up=5.0, gyroscope_noise=0.0, accelerometer_noise=0.0)
    )
    mcu = Microcontroller(simulated.ports, 0)
    counts = []
    for _ in range(3):
        simulated.step()
        counts += [sample.gyroscope[0] for sample in mcu.receive()]
        simulated.skip(60_000)  # 120 s
    changes = np.diff(counts) * 0.586
    assert changes == pytest.approx(
        [5.0 * (1 - np.exp(-1)), 5.0 * np.exp(-1) * (1 - np.exp(-1))], abs=0.6
    )
