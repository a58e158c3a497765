"""The torque of a drag beside the centre of mass, found by what the accelerometer feels."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.identification.drag_torque import drag_torques

ARM, RATIO, LAG, DT = 0.25, 0.016, 0.03, 0.002
INERTIA, MASS = np.array([0.0154, 0.0154, 0.025]), 1.3


@pytest.mark.parametrize("lever", [0.0, 0.02, -0.03])
def test_it_is_found_in_gusts_without_knowing_lever_or_inertia(lever: float) -> None:
    generator, count = np.random.default_rng(2), 15_000
    roots = np.full(4, np.sqrt(3.2))
    thrusts, rates, forces = np.empty((count, 4)), np.zeros((count, 3)), np.zeros((count, 3))
    drag_b = np.zeros((count - 1, 3))
    gust = np.zeros(2)
    for k in range(count):
        along = 0.1 * np.sign(np.sin(2.0 * k * DT)), 0.1 * np.sign(np.sin(3.1 * k * DT))
        thrusts[k] = 3.2 + np.array([-along[1], along[0], along[1], -along[0]])
        gust += DT / 1.0 * -gust + 0.3 * np.sqrt(2.0 * DT) * generator.normal(size=2)
        forces[k, :2] = gust
        if k + 1 < count:
            roots += -np.expm1(-DT / LAG) * (np.sqrt(thrusts[k]) - roots)
            front, left, rear, right = roots**2
            torque = np.array([ARM * (left - right), ARM * (rear - front), 0.0])
            rates[k + 1] = rates[k] + DT * torque / INERTIA
    forces[:, 2] = 9.81
    drag_b[:, 0], drag_b[:, 1] = (-lever * MASS * forces[1:, 1], lever * MASS * forces[1:, 0])
    rates[1:] += np.cumsum(DT * drag_b / INERTIA, axis=0)
    forces[:, :2] += generator.normal(size=(count, 2)) * 0.05
    found = drag_torques(
        np.full(count - 1, DT),
        rates,
        thrusts,
        forces,
        arm=ARM,
        torque_ratio=RATIO,
        motor_time_constant=LAG,
    )
    noise = abs(lever) * MASS * 0.05 + 2e-4
    assert np.sqrt(np.square(found - drag_b).mean()) < noise
