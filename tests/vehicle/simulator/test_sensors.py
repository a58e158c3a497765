"""Sensors: counts of the truth, with the configured noise and biases."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from quadrotor.constants import THRUST_PER_TURN
from quadrotor.records import Record
from quadrotor.vehicle_model import GRAVITY, reference_of_thrust
from vehicle.simulator.firmware.firmware import REGISTERS
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import new_plant
from vehicle.simulator.sensors import BLOCK, CHANNELS, Noise, new_sensors, sample
from vehicle.simulator.vibration import IMBALANCE, PITCH, turn_rotors
from vehicle_link.serial.ids import Id

QUIET = {"accelerometer_noise": 0.0, "gyroscope_noise": 0.0, "pressure_noise": 0.0} | {
    f"{sensor}_bias_{axis}": 0.0 for sensor in ("accelerometer", "gyroscope") for axis in "xyz"
}
COUNT = 0.0039 * 9.81


def read(plant: Record, parameters: SimulatorParameters) -> npt.NDArray[np.int16]:
    registers = np.zeros(REGISTERS, np.int16)
    sample(plant, new_sensors(parameters), np.zeros((1, CHANNELS)), 0, registers)
    return registers


def test_at_rest_without_noise() -> None:
    parameters = SimulatorParameters.model_validate(QUIET)
    registers = read(new_plant(parameters), parameters)
    assert registers[:6].tolist() == [512, 512, 768, 512, 512, 512]  # 1 g is 256.4 counts
    assert registers[Id.PRESSURE] == 6000
    assert registers[Id.BATTERY] == 168


def test_pressure_falls_by_11_6_pa_a_metre() -> None:
    parameters = SimulatorParameters.model_validate(QUIET)
    plant = new_plant(parameters)
    plant["x"][0, 2] = 10.0
    assert read(plant, parameters)[Id.PRESSURE] == 6000 - 116


def test_the_gyroscope_counts_0_586_deg_s() -> None:
    parameters = SimulatorParameters.model_validate(QUIET)
    plant = new_plant(parameters)
    plant["x"][0, 10:] = np.radians((58.6, -58.6, 5.86))
    assert read(plant, parameters)[3:6].tolist() == [612, 412, 522]


def test_sensors_saturate_at_ten_bits() -> None:
    parameters = SimulatorParameters.model_validate(QUIET)
    plant = new_plant(parameters)
    plant["specific_force_b"] = (100.0, -100.0, 19.0)
    plant["x"][0, 10:] = (10.0, -10.0, 0.0)
    assert read(plant, parameters)[:6].tolist() == [1023, 0, 1009, 1023, 0, 512]


def test_noise_and_bias_are_those_asked_for() -> None:
    parameters = SimulatorParameters(
        accelerometer_noise=0.5,
        accelerometer_bias_x=0.4,
        gyroscope_noise=3.0,
        gyroscope_bias_z=-2.0,
        pressure_noise=5.0,
    )
    plant, sensors, noise = new_plant(parameters), new_sensors(parameters), Noise(3)
    rows = []
    for _ in range(8 * BLOCK):
        registers = np.zeros(REGISTERS, np.int16)
        sample(plant, sensors, noise.block, noise.next_rows(1), registers)
        rows.append(registers)
    counts = np.array(rows, float)
    print("seed 3")
    assert (counts[:, 0].mean() - 512) * COUNT == pytest.approx(0.4, abs=0.04)
    assert counts[:, :3].std(axis=0) * COUNT == pytest.approx([0.5] * 3, rel=0.05)
    assert (counts[:, 5].mean() - 512) * 0.586 == pytest.approx(-2.0, abs=0.2)
    assert counts[:, 3:6].std(axis=0) * 0.586 == pytest.approx([3.0] * 3, rel=0.05)
    assert counts[:, Id.PRESSURE].std() == pytest.approx(5.0, rel=0.05)
    correlation = np.corrcoef(counts[:, :6].T) - np.eye(6)
    assert np.abs(correlation).max() < 0.08


def test_the_same_seed_gives_the_same_noise_in_every_block() -> None:
    def rows(seed: int) -> npt.NDArray[np.float64]:
        noise = Noise(seed)
        return np.array([noise.block[noise.next_rows(1)].copy() for _ in range(2 * BLOCK + 5)])

    assert (rows(1) == rows(1)).all()
    assert (rows(1) != rows(2)).any()
    assert (rows(1)[:BLOCK] != rows(1)[BLOCK : 2 * BLOCK]).any()


def test_vibration_has_its_rms_at_hover_lines_at_the_rotors_speeds_and_none_at_rest() -> None:
    from scipy.signal import welch

    parameters = SimulatorParameters.model_validate(
        QUIET | {"vibration": 2.0, "vibration_gyroscope": 10.0}
    )
    plant, sensors, noise = new_plant(parameters), new_sensors(parameters), Noise(3)
    hover = reference_of_thrust(
        parameters.mass * GRAVITY / 4, parameters.motor_slope, parameters.motor_offset
    )
    found = {}
    for speed in (hover, 0.0):
        plant["rotor_speeds"] = speed
        rows = []
        for _ in range(16 * BLOCK):
            turn_rotors(plant[0], 0.001)
            registers = np.zeros(REGISTERS, np.int16)
            sample(plant, sensors, noise.block, noise.next_rows(1), registers)
            rows.append(registers[:6])
        found[speed] = np.array(rows, float)
    flying = found[hover]
    rms = [2.0] * 3 + [10.0] * 3
    assert flying.std(axis=0) * ([COUNT] * 3 + [0.586] * 3) == pytest.approx(rms, rel=0.05)
    assert (found[0.0].std(axis=0) == 0.0).all()
    turns = np.sqrt(parameters.mass * GRAVITY / 4 / THRUST_PER_TURN)
    assert 50.0 < turns < 120.0
    frequency, power = welch(flying, 1000.0, nperseg=1000, axis=0)
    for axis, order in ((0, 1.0), (2, 2.0)):  # out of balance: once a turn; two blades: twice
        strongest = turns * order * PITCH[int(np.argmax(IMBALANCE))]
        assert frequency[power[:, axis].argmax()] == pytest.approx(strongest, abs=1.0)
    line = np.abs(frequency - turns) < 5.0
    assert power[line, 0].sum() / power[:, 0].sum() == pytest.approx(0.7, abs=0.05)


def test_biases_change_until_the_sensors_are_warm() -> None:
    parameters = SimulatorParameters.model_validate(
        QUIET | {"accelerometer_warm_up": 0.5, "gyroscope_warm_up": -3.0}
    )
    plant, sensors = new_plant(parameters), new_sensors(parameters)
    registers = np.zeros(REGISTERS, np.int16)
    for warmth in (0.0, 1.0):
        sensors["warmth"] = warmth
        sample(plant, sensors, np.zeros((1, CHANNELS)), 0, registers)
        assert (registers[0] - 512) * COUNT == pytest.approx(0.5 * warmth, abs=COUNT / 2)
        assert (registers[3] - 512) * 0.586 == pytest.approx(-3.0 * warmth, abs=0.3)
