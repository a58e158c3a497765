"""Lag of a motor in addition to a dead time, and steps of a bench without a known schedule."""

from __future__ import annotations

import numpy as np
import pytest

from estimation.calibration.motor_bench import held_steps
from estimation.calibration.time_constant import lag_and_dead_time
from quadrotor.errors import MeasurementError

LAG = 0.047


def response(time: np.ndarray, begins: np.ndarray, held: np.ndarray, delay: float) -> np.ndarray:
    """Return the lagged reference, computed in small steps."""
    fine, value, course = 1e-4, held[0], []
    grid = np.arange(time[0] - 0.2, time[-1] + fine, fine)
    wanted = held[np.maximum(np.searchsorted(begins, grid - delay, side="right") - 1, 0)]
    for one in wanted:
        course.append(value)
        value += (1.0 - np.exp(-fine / LAG)) * (one - value)
    return np.asarray(np.interp(time, grid, course))


@pytest.fixture
def steps(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return references and their begins, at irregular instants."""
    held = np.array([25.0, 60, 25, 90, 25, 120, 40, 150])
    return np.concatenate([[0.0], 0.5 + np.cumsum(0.5 + 0.3 * rng.random(7))]), held


@pytest.mark.parametrize("delay", [0.0, 0.0013, 0.012])
@pytest.mark.parametrize("rate", [100.0, 333.0])
def test_lag_and_dead_time_are_found_at_any_rate(
    steps: tuple[np.ndarray, np.ndarray], rng: np.random.Generator, delay: float, rate: float
) -> None:
    begins, held = steps
    ticks = np.arange(0.0, 7.0, 0.002)
    reference = held[np.searchsorted(begins, ticks, side="right") - 1]
    changed = ticks[np.concatenate([[0], np.flatnonzero(np.diff(reference)) + 1])]
    time = np.sort(rng.random(round(7.0 * rate))) * 7.0
    speed = 3.0 * response(time, changed, held, delay) + 8.0 + 0.5 * rng.standard_normal(len(time))
    epoch = 1.8e9  # s, like a vehicle's stamps
    found, dead_time = lag_and_dead_time(ticks + epoch, reference, time + epoch, speed)
    assert found.seconds == pytest.approx(LAG, rel=0.01)
    assert dead_time == pytest.approx(delay, abs=3e-4)
    assert abs(found.seconds - LAG) < 5 * found.error
    assert not found.warning


def test_a_force_alone_gives_it_with_a_warning(steps: tuple[np.ndarray, np.ndarray]) -> None:
    begins, held = steps
    time = np.arange(0.0, 7.0, 0.005)
    reference = held[np.searchsorted(begins, time, side="right") - 1]
    changed = time[np.concatenate([[0], np.flatnonzero(np.diff(reference)) + 1])]
    force = 1.598e-4 * (response(time, changed, held, 0.0) + 14.27) ** 2
    found, _ = lag_and_dead_time(time, reference, time, force, is_force=True)
    assert found.seconds == pytest.approx(LAG, rel=0.01)
    assert "force alone" in found.warning


def test_what_tells_no_lag_is_refused() -> None:
    time = np.arange(0.0, 4.0, 0.01)
    flat = np.full(len(time), 90.0)
    with pytest.raises(MeasurementError, match="moves by 0 counts"):
        lag_and_dead_time(time, flat, time, flat)
    step = np.where(time < 2.0, 30.0, 90.0)
    with pytest.raises(MeasurementError, match="41 samples since the first step"):
        lag_and_dead_time(time, step, time[:231], step[:231])
    with pytest.raises(MeasurementError, match="not finite"):
        lag_and_dead_time(time, step, time, np.where(time > 2.3, np.nan, step))
    with pytest.raises(MeasurementError, match="at the edge of what"):
        lag_and_dead_time(time, step, time, step)


def test_means_of_a_reference_held_several_times_are_put_together(rng: np.random.Generator) -> None:
    time = np.arange(0.0, 12.0, 0.01)
    reference = np.array([25.0, 50, 25, 70])[(time // 3.0).astype(int)]
    force = 0.01 * reference + 0.02 * rng.standard_normal(len(time))
    found = held_steps(time, reference, force, 0.1 * force)
    assert found.reference.tolist() == [25.0, 50.0, 70.0]
    assert found.samples.tolist() == pytest.approx([400, 200, 200], abs=2)
    assert found.force == pytest.approx([0.25, 0.5, 0.7], abs=0.006)
    assert found.force_error == pytest.approx([0.001, 0.0014, 0.0014], rel=0.2)
