"""Counts to SI units: scales pinned, T and b of Sec. 5.2 undone, drift kept."""

from __future__ import annotations

import math

import numpy as np
import pytest

from quadrotor.motor_state import MotorState
from quadrotor.records import IMU_SAMPLE, Record
from vehicle.boards.board import RawSample
from vehicle.boards.imu import ImuCalibration, ImuCalibrator
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.simulated_vehicle import SimulatedVehicle


def raw(accelerometer: tuple[int, int, int], gyroscope: tuple[int, int, int]) -> RawSample:
    return RawSample(7, accelerometer, gyroscope, 14.8, 96_000.0, MotorState.OFF)


def calibrated(raw: RawSample, parameters: ImuCalibration) -> Record:
    sample = np.zeros(1, IMU_SAMPLE)
    ImuCalibrator(parameters).calibrate(raw, sample)
    return sample


def test_a_count_is_0_0039_g_and_0_586_deg_s() -> None:
    sample = calibrated(raw((513, 512, 511), (512, 513, 511)), ImuCalibration())
    assert sample["stamp_ns"][0] == 7
    assert sample["specific_force_b"][0] == pytest.approx([0.0039 * 9.81, 0, -0.0039 * 9.81])
    degrees = np.degrees(sample["angular_velocity_b"][0])
    assert degrees == pytest.approx([0, 0.586, -0.586])


def test_it_undoes_a_known_mounting_and_bias() -> None:
    T = np.array([[0.98, 0.05, -0.02], [-0.04, 1.03, 0.01], [0.03, -0.02, 0.99]])
    bias = np.array([0.3, -0.2, 0.5])
    true = np.array([1.2, -3.4, 9.0])
    measured = np.linalg.solve(T, true) + bias
    counts = np.rint(measured / (0.0039 * 9.81) + 512).astype(int)
    names = [f"accelerometer_{row}{column}" for row in "xyz" for column in "xyz"]
    values = dict(zip(names, T.ravel().tolist(), strict=True))
    values |= {
        f"accelerometer_bias_{axis}": b for axis, b in zip("xyz", bias.tolist(), strict=True)
    }
    x, y, z = counts.tolist()
    sample = calibrated(raw((x, y, z), (512, 512, 512)), ImuCalibration(**values))
    assert sample["specific_force_b"][0] == pytest.approx(true, abs=0.0039 * 9.81)


def test_the_drift_found_at_the_start_survives_new_parameters() -> None:
    calibrator = ImuCalibrator(ImuCalibration())
    sample = np.zeros(1, IMU_SAMPLE)
    at_rest = raw((512, 512, 768), (514, 512, 512))
    calibrator.set_gyroscope_bias(np.array([math.radians(2 * 0.586), 0.0, 0.0]))
    calibrator.configure(ImuCalibration(accelerometer_bias_z=0.1))
    calibrator.calibrate(at_rest, sample)
    assert sample["angular_velocity_b"][0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert sample["specific_force_b"][0, 2] == pytest.approx(256 * 0.0039 * 9.81 - 0.1)
    calibrator.set_gyroscope_bias(np.zeros(3))
    calibrator.calibrate(at_rest, sample)
    assert sample["angular_velocity_b"][0, 0] == pytest.approx(math.radians(2 * 0.586))


def test_at_rest_the_specific_force_is_g_upwards() -> None:
    parameters = SimulatorParameters(
        accelerometer_bias_x=0.0, accelerometer_bias_y=0.0, accelerometer_bias_z=0.0
    )
    simulated = SimulatedVehicle(parameters)
    mcu = Microcontroller(simulated.ports, 0)
    samples = []
    for _ in range(1000):
        simulated.step()
        samples += [calibrated(received, ImuCalibration()) for received in mcu.receive()]
    forces = np.concatenate(samples)["specific_force_b"]
    rates = np.degrees(np.concatenate(samples)["angular_velocity_b"])
    noise = math.hypot(parameters.accelerometer_noise, 0.0039 * 9.81 / math.sqrt(12))
    assert forces.mean(axis=0) == pytest.approx([0, 0, 9.81], abs=5 * noise / math.sqrt(1000))
    assert forces.std(axis=0) == pytest.approx([noise] * 3, rel=0.15)
    drift = (parameters.gyroscope_bias_x, parameters.gyroscope_bias_y, parameters.gyroscope_bias_z)
    assert rates.mean(axis=0) == pytest.approx(drift, abs=0.06)
    assert rates.std(axis=0).max() < 1.0  # the vehicle's own limit for being still
